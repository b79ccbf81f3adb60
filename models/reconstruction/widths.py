"""The radius in meters, from the widths in pixels."""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.reconstruction.views import Samples, View

_NEAR_PX = 4.0


def radius_along(points_m: FloatArray, views: list[View], strands: list[IntArray]) -> tuple[FloatArray, float]:
    """(n,) radius at (n, 3) points, the median over the views that see them (NaN where none does), and the
    standard deviation of the whole DLO's radius as the views disagree about it.

    A cylinder of radius r at depth z appears ``2 r f / z`` wide, whichever way it runs, while r is small against z.
    """
    values = np.full((len(views), len(points_m)), np.nan)
    for k, (view, which) in enumerate(zip(views, strands, strict=True)):
        seen = Samples.of(view.strands, which)
        if not len(seen.xy):
            continue
        depth = view.camera.in_camera(points_m)[:, 2]
        xy = np.nan_to_num(view.camera.project(points_m), nan=-1e6)
        distance, nearest = seen.tree.query(xy, distance_upper_bound=_NEAR_PX)
        hit = np.isfinite(distance)
        values[k, hit] = seen.width_px[nearest[hit]] / 2 * depth[hit] / view.camera.focal_px
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
