"""Least-squares B-splines through ordered points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline

from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths

_MOST_SPANS = 64
"""However many points there are."""


@dataclass(frozen=True, eq=False)
class Spline:
    """B-spline over the parameter 0 to 1: ``len(knots) == len(control_xy) + degree + 1``."""

    degree: int
    knots: FloatArray
    control_xy: FloatArray

    def at(self, parameters: FloatArray) -> FloatArray:
        """Points ``(m, 2)`` at ``m`` parameters in [0, 1]."""
        points: FloatArray = BSpline.construct_fast(self.knots, self.control_xy, self.degree)(
            parameters
        )
        return points


def fit_spline(points_xy: FloatArray, *, tolerance_px: float, spans: int | None = None) -> Spline:
    """Clamped least-squares spline (cubic if there are 4 points or more) within the tolerance.

    ``points_xy``: ``(n, 2)``, ``n >= 2``, no two neighbors equal. The number of spans starts at
    ``spans``, else at one per 8 points, and doubles until the root mean square distance between
    points and curve is at most ``tolerance_px``, there are two points a span, or 64 spans.
    The curve starts and ends at the outer points.
    """
    lengths = arc_lengths(points_xy)
    parameters = lengths / lengths[-1]
    degree = min(3, len(points_xy) - 1)
    at_most = max(1, min((len(points_xy) - degree) // 2, _MOST_SPANS))
    weights = np.ones(len(points_xy))
    weights[[0, -1]] = 1e3
    count = min(at_most, max(1, len(points_xy) // 8 if spans is None else spans))
    while True:
        spline, error = _fit(points_xy, parameters, weights, degree, count)
        if error <= tolerance_px or count >= at_most:
            return spline
        count = min(2 * count, at_most)


def _fit(
    points_xy: FloatArray, parameters: FloatArray, weights: FloatArray, degree: int, spans: int
) -> tuple[Spline, float]:
    """The spline of so many spans, each with as many points, and its root mean square error."""
    inner = np.interp(np.arange(1, spans) / spans, np.linspace(0, 1, len(parameters)), parameters)
    knots = np.concatenate((np.zeros(degree + 1), inner, np.ones(degree + 1)))
    fitted = make_lsq_spline(parameters, points_xy, knots, k=degree, w=weights, check_finite=False)
    error = float(np.sqrt(np.mean(np.sum((fitted(parameters) - points_xy) ** 2, axis=1))))
    return Spline(degree, knots, fitted.c), error
