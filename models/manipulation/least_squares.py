"""Many small nonlinear problems at once: sum of distances |r_i(x)| over a box, by damped
Gauss-Newton.

The thesis takes 500 (actions) or 3000 (parameters) plain gradient steps on the same sum of norms
(eq. 5.6). Here each step solves the weighted least squares problem that touches it (weights 1 /
|r_i|), a few unknowns a problem, with the damping of Levenberg and Marquardt; a step that does not
help is taken back. Nothing is random.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Residuals = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""(B, K) unknowns to residual vectors (B, m, 2) and derivatives (B, m, 2, K)."""


@dataclass(frozen=True)
class SolverParams:
    """``steps`` at most; ``tolerance`` relative gain of all problems below which it stops;
    ``smooth`` m below which a distance counts as zero."""

    steps: int = 12
    tolerance: float = 1e-4
    smooth: float = 5e-4


@dataclass(frozen=True, eq=False)
class Minimum:
    """``x`` (B, K), its ``cost`` (B,) sum of distances, the residuals' derivatives there, and
    whether the last step gained less than the tolerance."""

    x: FloatArray
    cost: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    converged: NDArray[np.bool_]


def minimize(
    residuals: Residuals,
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    scale: FloatArray,
    params: SolverParams,
) -> Minimum:
    """From ``start`` (B, K) inside the box ``low`` to ``high`` ((K,) or (B, K)); ``scale`` (K,) of
    the unknowns."""
    x = np.clip(start, low, high)
    r, jacobian = residuals(x)
    cost = _cost(r)
    damping = np.full(len(x), 1e-2)
    converged = np.zeros(len(x), bool)
    for _ in range(params.steps):
        step = _step(r, jacobian * scale, damping, params.smooth) * scale
        tried = np.clip(x + step, low, high)
        r_tried, jacobian_tried = residuals(tried)
        cost_tried = _cost(r_tried)
        better = cost_tried < cost
        gain = (cost - cost_tried) / np.maximum(cost, 1e-12)
        converged = better & (gain < params.tolerance) | (~better & (damping > 1e2))
        x = np.where(better[:, None], tried, x)
        r = np.where(better[:, None, None], r_tried, r)
        jacobian = np.where(better[:, None, None, None], jacobian_tried, jacobian)
        cost = np.where(better, cost_tried, cost)
        damping = np.clip(np.where(better, damping / 5, damping * 8), 1e-6, 1e6)
        if converged.all():
            break
    return Minimum(x, cost, r, jacobian, converged)


def _cost(r: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(r[..., 0], r[..., 1]).sum(1))


def _step(r: FloatArray, jacobian: FloatArray, damping: FloatArray, smooth: float) -> FloatArray:
    weights = 1 / np.maximum(np.hypot(r[..., 0], r[..., 1]), smooth)
    weighted = jacobian * weights[..., None, None]
    normal = np.einsum("bnik,bnil->bkl", weighted, jacobian)
    gradient = np.einsum("bnik,bni->bk", weighted, r)
    unknowns = np.arange(normal.shape[1])
    diagonal = normal[:, unknowns, unknowns]
    floor = 1e-6 * diagonal.max(1, initial=1e-12)[:, None]
    normal[:, unknowns, unknowns] += damping[:, None] * np.maximum(diagonal, floor) + floor
    return -np.asarray(np.linalg.solve(normal, gradient[..., None])[..., 0])
