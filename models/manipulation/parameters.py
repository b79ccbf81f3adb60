"""Parameter estimation (thesis 5.5.2, eq. 5.10): k_b and k_d from what actions did, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import SolverParams, minimize
from models.manipulation.simulator import BENDING, DAMPING

MID_RANGE = (0.5, 14.0)
"""k_b and k_d to begin with when nothing is known (5.7.2)."""

_STARTS = ((-2.0, 2.2), (-1.0, 2.2), (-0.2, 2.2), (-2.0, 3.1), (-1.0, 3.1))
"""Logarithms of k_b and k_d."""
_SOLVER = SolverParams(steps=15)
_TRUST_M = 2e-3
"""Unexplained motion of this size in the mean is expected: of cameras, tables and the network."""
_PRIOR = 0.9
"""Spread of the logarithms that is expected before anything is seen: a thing never measured stays at mid-range."""


@dataclass(frozen=True, eq=False)
class History:
    """M actions and what they did: ``before`` and ``after`` (M, n, 2) m, ``edge`` (M,), ``move`` (M, 3)."""

    before: FloatArray
    edge: IntArray
    move: FloatArray
    after: FloatArray


@dataclass(frozen=True, eq=False)
class Estimate:
    """``bending`` k_b and ``damping`` k_d; ``covariance`` (2, 2) of their logarithms; ``error_m`` mean node distance
    (M,) of every sample that is left with them, and ``error_before_m`` with the mid-range."""

    bending: float
    damping: float
    covariance: FloatArray
    error_m: FloatArray
    error_before_m: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """(2,) standard deviations of the logarithms."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def ratio_sigma(self) -> float:
        """Standard deviation of log(k_b / k_d)."""
        (a, b), (_, c) = self.covariance
        return float(np.sqrt(max(a - 2 * b + c, 0.0)))

    def rope(self, mass: float) -> FloatArray:
        return np.array([mass, self.bending, self.damping])


def estimate(dynamics: Dynamics, history: History, mass: float) -> Estimate:
    """The parameters that explain ``history`` best; deterministic. An empty history gives the mid-range."""
    if not len(history.edge):
        return Estimate(*MID_RANGE, _PRIOR**2 * np.eye(2), np.zeros(0), np.zeros(0))
    middle = np.log(MID_RANGE)
    samples, nodes = history.before.shape[:2]
    prior = np.sqrt(2.0) * nodes * _TRUST_M / _PRIOR

    def residuals(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        starts = len(logs)
        ropes = np.column_stack([np.full(starts, mass), np.exp(logs)]).repeat(samples, 0)
        before, move = np.tile(history.before, (starts, 1, 1)), np.tile(history.move, (starts, 1))
        reached, jacobian = dynamics.by_rope(before, np.tile(history.edge, starts), move, ropes)
        r = (reached.reshape(starts, samples, nodes, 2) - history.after).reshape(starts, -1, 2)
        d = (jacobian * ropes[:, None, None, 1:]).reshape(starts, -1, 2, 2)
        # One more residual draws towards the mid-range what the samples leave open.
        away = (prior * (logs - middle))[:, None]
        slope = np.broadcast_to(prior * np.eye(2), (starts, 1, 2, 2))
        return np.concatenate([r, away], 1), np.concatenate([d, slope], 1)

    low, high = np.log([BENDING[0], DAMPING[0]]), np.log([BENDING[1], DAMPING[1]])
    found = minimize(residuals, np.array(_STARTS), low, high, np.ones(2), _SOLVER)
    best = int(np.argmin(found.cost))
    bending, damping = np.exp(found.x[best])
    error = np.hypot(*np.moveaxis(found.residuals[best, :-1].reshape(samples, nodes, 2), -1, 0)).mean(1)
    unexplained = max(float(error.mean()), _TRUST_M)
    information = np.einsum("nik,nil->kl", found.jacobian[best, :-1], found.jacobian[best, :-1]) / unexplained**2
    # Neighboring nodes err together: about four of them count as one observation.
    covariance = np.linalg.inv(information / 4 + np.eye(2) / _PRIOR**2)
    ropes = np.broadcast_to([mass, *MID_RANGE], (samples, 3))
    guessed = dynamics.predict(history.before, history.edge, history.move, ropes)
    return Estimate(float(bending), float(damping), covariance, error, shape_distance(guessed, history.after))
