"""The radius in meters, from the widths in pixels."""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.reconstruction.views import Samples, View

_NEAR_PX = 4.0


def radius_along(
    points_m: FloatArray, views: list[View], strands: list[IntArray]
) -> tuple[FloatArray, float]:
    """(n,) radius at (n, 3) points, the median over the views that see them (NaN where none does),
    and the standard deviation of the whole DLO's radius as the views disagree about it.

    A cylinder appears as wide as its two sides are apart, seen from the camera, across its own
    direction in the picture, while its radius is small against its distance: ``2 r f / z`` on the
    optical axis, wider off it.
    """
    values = np.full((len(views), len(points_m)), np.nan)
    for k, (view, which) in enumerate(zip(views, strands, strict=True)):
        seen = Samples.of(view.strands, which)
        if not len(seen.xy):
            continue
        scale = _px_per_m(view.camera.in_camera(points_m), view.camera.focal_px)
        xy = np.nan_to_num(view.camera.project(points_m), nan=-1e6)
        distance, nearest = seen.tree.query(xy, distance_upper_bound=_NEAR_PX)
        hit = np.isfinite(distance)
        values[k, hit] = seen.width_px[nearest[hit]] / 2 / scale[hit]
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(points_m), np.nan), float("nan")
    radius = np.full(len(points_m), np.nan)
    some = known.any(axis=0)
    radius[some] = np.nanmedian(values[:, some], axis=0)
    by_view = np.array([np.median(row[k]) for row, k in zip(values, known, strict=True) if k.any()])
    spread = float(np.std(by_view, ddof=1)) if len(by_view) > 1 else 0.0
    within = float(1.4826 * np.median(np.abs(radius[some] - np.median(radius[some]))))
    return radius, float(np.hypot(spread, within)) / np.sqrt(len(by_view))


def _px_per_m(points: FloatArray, focal_px: float) -> FloatArray:
    """(n,) pixels across the picture of a line through (n, 3) ``points``, m in the camera's axes,
    that a meter is which is at right angles to the line and to the view of it; at least the
    smallest positive number."""
    along = np.gradient(points, axis=0)
    side = np.cross(along, points)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    depth = points[:, 2:]
    seen_along, seen_side = (v[:, :2] - points[:, :2] * v[:, 2:] / depth for v in (along, side))
    across = np.abs(seen_side[:, 0] * seen_along[:, 1] - seen_side[:, 1] * seen_along[:, 0])
    length = np.maximum(np.hypot(seen_along[:, 0], seen_along[:, 1]), 1e-12)
    return np.maximum(focal_px / np.abs(depth[:, 0]) * across / length, np.finfo(float).tiny)
