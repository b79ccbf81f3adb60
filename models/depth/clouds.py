"""The camera that took an organised point cloud, from the points themselves.

Strategy: of a camera without distortion, a pixel's column is a linear function of x / z, its row of
y / z. Least squares give both, twice: what is far off the first time does not count the second
time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray
from models.geometry.cameras import Camera

Points = Float32Array | FloatArray

_FEWEST = 50
"""Points that have to be known."""
_LEAST_FIELD = 0.01
"""Of x / z and y / z: their standard deviation where there is a picture and not a line."""
_MOST_SAMPLES = 20_000
_FAR = 3.0
"""Medians from which on a point does not count."""


@dataclass(frozen=True)
class Pinhole:
    """``fx, fy, cx, cy`` px; ``off_px`` median distance of the points' pictures from their
    pixels."""

    fx: float
    fy: float
    cx: float
    cy: float
    off_px: float


def pinhole_of(points_m: Points) -> Pinhole | None:
    """Of points (H, W, 3) in the camera's frame, z forward, NaN where unknown; None where they show
    no camera."""
    xy, seen = _seen(points_m)
    if len(xy) < _FEWEST or (seen.std(0) < _LEAST_FIELD).any():
        return None
    keep = np.ones(len(xy), bool)
    for _ in range(2):
        (cx, fx), (cy, fy) = (_line(seen[keep, k], xy[keep, k]) for k in (0, 1))
        off = np.hypot(*(seen * (fx, fy) + (cx, cy) - xy).T)
        keep = off <= max(_FAR * float(np.median(off)), 1e-6)
    return Pinhole(fx, fy, cx, cy, float(np.median(off))) if fx > 0 and fy > 0 else None


def off_px(points_m: Points, camera: Camera) -> float:
    """Median distance, px, of where ``camera``, at its own origin, sees the points (H, W, 3) from
    their pixels."""
    xy, seen = _seen(points_m)
    i = camera.intrinsics
    ideal = seen * (i.fx, i.fy) + (i.cx, i.cy)
    away = np.hypot(*(camera.distort(ideal) - xy).T)
    return float(np.median(np.nan_to_num(away, nan=np.inf))) if len(away) else np.inf


def _seen(points_m: Points) -> tuple[FloatArray, FloatArray]:
    """Pixels (n, 2) of some known points, and their (x, y) / z."""
    known = np.argwhere(np.isfinite(points_m).all(2) & (points_m[..., 2] > 0))
    known = known[:: max(len(known) // _MOST_SAMPLES, 1)]
    points = points_m[known[:, 0], known[:, 1]].astype(float)
    return known[:, ::-1].astype(float), points[:, :2] / points[:, 2:]


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Offset and slope."""
    slope, offset = np.polyfit(x, y, 1)
    return float(offset), float(slope)
