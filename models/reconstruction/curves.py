"""3D curves: a cubic B-spline, and the curve with what is known about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths

DEGREE = 3


@dataclass(frozen=True, eq=False)
class Spline3D:
    """Clamped cubic B-spline over the parameter 0 to 1; ``control_m`` (m, 3), ``len(knots) == m +
    4``."""

    knots: FloatArray
    control_m: FloatArray

    def at(self, parameters: FloatArray) -> FloatArray:
        """(n, 3) points at (n,) parameters."""
        points: FloatArray = BSpline.construct_fast(self.knots, self.control_m, DEGREE)(parameters)
        return points

    def tangents(self, parameters: FloatArray) -> FloatArray:
        """(n, 3) unit tangents at (n,) parameters."""
        slope = BSpline.construct_fast(self.knots, self.control_m, DEGREE).derivative()(parameters)
        unit: FloatArray = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
        return unit


@dataclass(frozen=True, eq=False)
class Curve:
    """One DLO in the world.

    ``points_m`` (n, 3) at about equal arc length; ``covariance_m2`` (n, 3, 3) of the position
    *across* the curve (how far along it a point is, is a matter of convention, so the direction of
    the curve carries none); ``radius_m`` (n,), NaN where it is not known, and ``radius_sigma_m`` of
    the whole.
    """

    spline: Spline3D
    points_m: FloatArray
    covariance_m2: FloatArray
    radius_m: FloatArray
    radius_sigma_m: float

    @property
    def sigma_m(self) -> FloatArray:
        """(n,) standard deviation in the worst direction."""
        return np.sqrt(np.maximum(np.linalg.eigvalsh(self.covariance_m2)[:, -1], 0.0))

    @property
    def length_m(self) -> float:
        return float(arc_lengths(self.points_m)[-1])

    @property
    def mean_radius_m(self) -> float:
        known = self.radius_m[np.isfinite(self.radius_m)]
        return float(np.median(known)) if len(known) else float("nan")

    def reversed(self) -> Curve:
        flipped = Spline3D(1.0 - self.spline.knots[::-1], self.spline.control_m[::-1])
        return replace(
            self,
            spline=flipped,
            points_m=self.points_m[::-1],
            covariance_m2=self.covariance_m2[::-1],
            radius_m=self.radius_m[::-1],
        )


def clamped_knots(spans: int) -> FloatArray:
    return np.concatenate((np.zeros(DEGREE), np.linspace(0, 1, spans + 1), np.ones(DEGREE)))


def basis(knots: FloatArray, parameters: FloatArray) -> FloatArray:
    """(n, m) values of the B-spline functions (the matrix B of thesis section 4.5.2)."""
    dense: FloatArray = BSpline.design_matrix(
        np.clip(parameters, 0.0, 1.0), knots, DEGREE
    ).toarray()
    return dense


def third_differences(count: int) -> FloatArray:
    """(count - 3, count) matrix of control points to their third differences; of fewer than four
    points to the highest there are."""
    return np.diff(np.eye(count), n=min(3, count - 1), axis=0)


def fit(
    points_m: FloatArray, spans: int, smooth: float = 1e-4, parameters: FloatArray | None = None
) -> Spline3D:
    """Least squares through (n, 3) points in order; ``smooth`` weighs the third differences of the
    control points, so that fewer points than control points do no harm."""
    if parameters is None:
        along = arc_lengths(points_m)
        parameters = along / along[-1]
    knots = clamped_knots(spans)
    matrix = basis(knots, parameters)
    rough = third_differences(matrix.shape[1])
    normal = matrix.T @ matrix + smooth * len(points_m) / spans * rough.T @ rough
    normal += 1e-9 * np.eye(len(normal))
    return Spline3D(knots, np.asarray(np.linalg.solve(normal, matrix.T @ points_m), np.float64))


def at_equal_lengths(
    spline: Spline3D, count: int, begin: float = 0.0, end: float = 1.0
) -> FloatArray:
    """(count,) parameters of points at equal arc length between the parameters ``begin`` and
    ``end``."""
    fine = np.linspace(begin, end, max(20 * count, 400))
    along = arc_lengths(spline.at(fine))
    return np.interp(np.linspace(0, along[-1], count), along, fine)


def distances(points_m: FloatArray, curve_m: FloatArray) -> FloatArray:
    """(n,) distance of (n, 3) points to the polyline through (m, 3) ``curve_m``."""
    count = min(len(curve_m) - 1, 3)
    _, nearest = cKDTree(curve_m).query(points_m, k=count)
    best = np.full(len(points_m), np.inf)
    for column in nearest.reshape(len(points_m), -1).T:
        for start in (np.maximum(column - 1, 0), np.minimum(column, len(curve_m) - 2)):
            step = curve_m[start + 1] - curve_m[start]
            share = np.einsum("ni,ni->n", points_m - curve_m[start], step)
            share /= np.maximum(np.einsum("ni,ni->n", step, step), 1e-18)
            foot = curve_m[start] + np.clip(share, 0, 1)[:, None] * step
            best = np.minimum(best, np.linalg.norm(points_m - foot, axis=1))
    return best
