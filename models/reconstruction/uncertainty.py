"""What is admitted about depth that cannot be seen, and whether a stated covariance holds (the test
that the benchmark and the tests apply)."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.cameras import NEAREST_M, Camera
from models.reconstruction.curves import Curve

_UNSEEN = 0.15
"""Standard deviation, as a share of the distance, from which on depth is not seen: its inverse may
as well be 0."""
_LEAST_PARALLAX_PX = 2.5
_ANYWHERE = 2.0
"""Standard deviation, as a share of the distance, of depth that is not seen."""
_WORTH_A_WORD = 0.1
"""Share of a curve's points."""
_SHALLOW = 0.17
"""Sine of the angle to the epipolar lines below which a DLO runs along them."""
_GOOD_BASELINE = 0.05
"""As a share of the distance."""


def admitted(covariance_m2: FloatArray, points_m: FloatArray, cameras: list[Camera]) -> FloatArray:
    """(n, 3, 3) ``covariance_m2`` of (n, 3) points of a curve, enlarged where it is no measure of
    errors any more.

    What is so unsure that errors are no longer in proportion is stated not to be known at all. So
    is what moves by less than ``_LEAST_PARALLAX_PX`` from camera to camera: whatever shifts the
    centerlines a little then puts the DLO anywhere. A few points among such are no better.
    """
    values, axes = np.linalg.eigh(covariance_m2)
    distance = _distance(points_m, cameras)
    lost = (values[:, -1] > (_UNSEEN * distance) ** 2) | (
        _parallax_px(points_m, cameras) < _LEAST_PARALLAX_PX
    )
    lost |= median_filter(lost.astype(np.int8), size=max(len(lost) // 4, 1), mode="mirror") > 0
    add = np.where(lost, (_ANYWHERE * distance) ** 2, 0.0)
    worst = axes[:, :, -1]
    return np.asarray(covariance_m2 + add[:, None, None] * worst[:, :, None] * worst[:, None, :])


def depth_warning(curve: Curve, cameras: list[Camera]) -> str | None:
    """What to move where a part of ``curve`` has a depth that ``cameras`` do not show; None if they
    show all of it."""
    points = curve.points_m
    distance = _distance(points, cameras)
    lost = curve.sigma_m > _UNSEEN * distance
    share = float(lost.mean())
    if share < _WORTH_A_WORD:
        return None
    part = "all of the DLO" if share > 1 - _WORTH_A_WORD else f"{100 * share:.0f} % of the DLO"
    begin = f"the depth of {part} cannot be seen from these views"
    away = float(np.median(distance[lost]))
    baseline = _baseline(points[lost].mean(axis=0), cameras)
    if (
        baseline > _GOOD_BASELINE * away
        and float(np.median(steepness_in_space(points, cameras)[lost])) < _SHALLOW
    ):
        return f"{begin}: it runs along the way of the camera. Move the camera across the DLO, not along it"
    wanted = 1000 * _GOOD_BASELINE * away
    moved = f"the camera moved {1000 * baseline:.3g} mm across its line of sight at {away:.3g} m"
    return f"{begin}: {moved}. Move it at least {wanted:.0f} mm, across the DLO"


def _distance(points_m: FloatArray, cameras: list[Camera]) -> FloatArray:
    """(n,) from the nearest camera."""
    away = np.min([np.linalg.norm(points_m - c.center, axis=1) for c in cameras], axis=0)
    return np.asarray(np.maximum(away, NEAREST_M))


def _parallax_px(points_m: FloatArray, cameras: list[Camera]) -> FloatArray:
    """(n,) how far across the curve a point moves between two cameras, against one at infinity; of
    those cameras for which it is most."""
    best = np.zeros(len(points_m))
    distance = _distance(points_m, cameras)
    for number, first in enumerate(cameras):
        for second in cameras[number + 1 :]:
            seen = (
                _baseline(points_m.mean(axis=0), [first, second])
                * max(first.focal_px, second.focal_px)
                / distance
            )
            best = np.maximum(best, seen * steepness_in_space(points_m, [first, second]))
    return best


def _baseline(point: FloatArray, cameras: list[Camera]) -> float:
    """Largest distance between two cameras, as seen from ``point`` (3,)."""
    ray = point - np.mean([c.center for c in cameras], axis=0)
    ray /= max(float(np.linalg.norm(ray)), NEAREST_M)
    centers = np.stack([c.center for c in cameras])
    flat = centers - (centers @ ray)[:, None] * ray
    return float(np.linalg.norm(flat[:, None] - flat[None], axis=-1).max())


def steepness_in_space(points_m: FloatArray, cameras: list[Camera]) -> FloatArray:
    """(n,) sine of the angle between a curve through (n, 3) points and the epipolar plane, of the
    two cameras for which it is largest."""
    tangent = np.gradient(points_m, axis=0)
    best = np.zeros(len(points_m))
    for number, first in enumerate(cameras):
        ray = points_m - first.center
        ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), NEAREST_M)
        across = tangent - np.einsum("ni,ni->n", tangent, ray)[:, None] * ray
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        for second in cameras[number + 1 :]:
            normal = np.cross(ray, second.center - first.center)
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
            best = np.maximum(best, np.abs(np.einsum("ni,ni->n", across, normal)))
    return best


def covers(curve: Curve, truth_m: FloatArray, level: float) -> BoolArray:
    """(n,) whether the true curve, (m, 3) dense points, passes through the ellipsoid of ``level``
    around each point.

    The covariance has two dimensions, across the curve; the true curve's nearest point is compared
    there.
    """
    _, nearest = cKDTree(truth_m).query(curve.points_m)
    off = truth_m[nearest] - curve.points_m
    values, axes = np.linalg.eigh(curve.covariance_m2)
    along = np.einsum("nij,ni->nj", axes[:, :, 1:], off)
    squared = np.sum(along**2 / np.maximum(values[:, 1:], 1e-18), axis=1)
    inside: BoolArray = squared <= -2.0 * np.log1p(
        -level
    )  # the chi-squared quantile of two degrees of freedom
    return inside
