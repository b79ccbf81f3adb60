"""Parameter estimation (thesis 5.5.2, eq. 5.10): k_b and k_d from what actions did, with their
uncertainty.

Strategy: eq. 5.10 with the network, from a few starts at once. A slow motion shows the ratio k_b /
k_d well, but either of them only through the little that the DLO stretches, less than the network's
own error. So the optimum is then polished with the analytical model itself: two steps of weighted
least squares, whose derivatives are differences of simulations, all in one batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import SolverParams, minimize
from models.manipulation.simulator import BENDING, DAMPING, Actions, Ropes, simulate

MID_RANGE = (0.5, 14.0)
"""k_b and k_d to begin with when nothing is known (5.7.2)."""

_STARTS = ((-2.0, 2.2), (-0.6, 2.2), (-1.6, 3.1))
"""Logarithms of k_b and k_d."""
_SOLVER = SolverParams(steps=15)
_BOX = (np.log([BENDING[0], DAMPING[0]]), np.log([BENDING[1], DAMPING[1]]))
_TRUST_M = 1e-3
"""Unexplained motion of this size in the mean is expected of the network …"""
_EXACT_M = 2e-4
"""… and at least this much, of cameras and tables, even of the analytical model."""
_POLISH = 2
_DIFFERENCE = 0.02
_PRIOR = 0.9
"""Spread of the logarithms that is expected before anything is seen: a thing never measured stays
at mid-range."""


@dataclass(frozen=True, eq=False)
class History:
    """M actions and what they did: ``before`` and ``after`` (M, n, 2) m, ``edge`` (M,), ``move``
    (M, 3)."""

    before: FloatArray
    edge: IntArray
    move: FloatArray
    after: FloatArray

    def latest(self, count: int) -> History:
        last = slice(max(len(self.edge) - count, 0), None)
        return History(self.before[last], self.edge[last], self.move[last], self.after[last])


@dataclass(frozen=True, eq=False)
class Estimate:
    """``bending`` k_b and ``damping`` k_d; ``covariance`` (2, 2) of their logarithms; ``error_m``
    mean node distance (M,) of every sample that is left with them, and ``error_before_m`` with the
    mid-range."""

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


def estimate(
    dynamics: Dynamics, history: History, mass: float, length: float | None = None
) -> Estimate:
    """The parameters that explain ``history`` best; deterministic. An empty history gives the
    mid-range.

    ``mass`` kg; ``length`` m of the DLO at rest, by default that of the first state, as a DLO that
    was never pulled.
    """
    return polished(fitted(dynamics, history, mass), history, mass, length)


def fitted(dynamics: Dynamics, history: History, mass: float) -> Estimate:
    """The parameters under which the network explains ``history`` best: the ratio is right, each of
    them is not."""
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

    found = minimize(residuals, np.array(_STARTS), *_BOX, np.ones(2), _SOLVER)
    k = int(np.argmin(found.cost))
    r = found.residuals[k, :-1].reshape(samples, nodes, 2)
    error = np.hypot(r[..., 0], r[..., 1]).mean(1)
    information = _information(
        found.jacobian[k, :-1].reshape(samples, nodes, 2, 2), _weight(error, _TRUST_M)
    )
    ropes = np.broadcast_to([mass, *MID_RANGE], (samples, 3))
    guessed = dynamics.predict(history.before, history.edge, history.move, ropes)
    bending, damping = np.exp(found.x[k]).tolist()
    return Estimate(
        bending, damping, _covariance(information), error, shape_distance(guessed, history.after)
    )


def polished(
    found: Estimate, history: History, mass: float, length: float | None = None
) -> Estimate:
    """The estimate after two steps with the analytical model."""
    if not len(history.edge):
        return found
    logs = np.log([found.bending, found.damping])
    length = length_at_rest(history) if length is None else length
    for _ in range(_POLISH):
        logs, error, covariance = _polished(history, mass, length, logs)
    bending, damping = np.exp(logs).tolist()
    return Estimate(bending, damping, covariance, error, found.error_before_m)


def length_at_rest(history: History) -> float:
    """m, of a DLO that was not pulled before its first action."""
    return float(np.hypot(*np.diff(history.before[0], axis=0).T).sum())


def _weight(error: FloatArray, least: float) -> FloatArray:
    """(M,) of samples by their error (M,) m. Samples that stay far off count less; neighboring
    nodes err together: half of them, eight, are one observation."""
    unexplained = max(float(np.median(error)), least)
    return np.asarray(
        np.minimum(1.0, 3 * unexplained / np.maximum(error, 1e-9)) / unexplained**2 / 8
    )


def _information(slopes: FloatArray, weight: FloatArray) -> FloatArray:
    """(2, 2) on the logarithms, of derivatives (M, n, 2, 2) by them and what is expected
    beforehand."""
    seen = np.einsum("snik,snil->kl", slopes * weight[:, None, None, None], slopes)
    return np.asarray(seen + np.eye(2) / _PRIOR**2)


def _covariance(information: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(information), np.float64)


def _polished(
    history: History, mass: float, length: float, logs: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A step of weighted least squares with the analytical model: new logarithms, the samples'
    errors before it, and the covariance."""
    samples = len(history.edge)
    tried = logs + _DIFFERENCE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    k_b, k_d = np.exp(tried).repeat(samples, 0).T
    ropes = Ropes(np.full(3 * samples, mass), k_b, k_d, np.full(3 * samples, length))
    actions = Actions(
        np.tile(history.edge, 3),
        np.tile(history.move[:, :2], (3, 1)),
        np.tile(history.move[:, 2], 3),
    )
    reached = simulate(np.tile(history.before, (3, 1, 1)), actions, ropes).reshape(
        3, *history.before.shape
    )
    r = reached[0] - history.after
    slopes = np.stack([reached[1] - reached[0], reached[2] - reached[0]], -1) / _DIFFERENCE
    error = shape_distance(reached[0], history.after)
    weight = _weight(error, _EXACT_M)
    information = _information(slopes, weight)
    pull = (
        np.einsum("snik,sni->k", slopes * weight[:, None, None, None], r)
        + (logs - np.log(MID_RANGE)) / _PRIOR**2
    )
    step = np.clip(-np.linalg.solve(information, pull), -1.0, 1.0)
    return np.clip(logs + step, *_BOX), error, _covariance(information)
