"""The pen's strokes as lines in a picture (thesis 2.5.2, 2.5.3): transformed, smoothed, projected,
cut to the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_splprep

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.cameras import Camera
from models.geometry.components import runs
from models.geometry.polylines import arc_lengths, resample

_MOST_SAMPLES = 400
_COMB_M = 1e-4
"""Points of a stroke nearer to one another than this are one: a pen held still."""
_NEAR_PX = 100.0
"""So far outside of the picture a stroke still has a place: the smoothing needs what comes before
and after."""


class StrokeError(ValueError):
    """A stroke that describes no line; the message names what is wrong with it."""


@dataclass(frozen=True, eq=False)
class ProjectedStroke:
    """``n`` samples of a stroke in one view: ``xy`` (n, 2) pixels of the picture, ``depth_m`` (n,),
    ``inside`` (n,) whether the sample is in front of the camera and in the picture. Sample i is the
    same point in every view."""

    xy: FloatArray
    depth_m: FloatArray
    inside: BoolArray


def smooth_stroke(points_m: FloatArray, step_m: float, tolerance_m: float) -> FloatArray:
    """(n, 3) samples, about ``step_m`` apart, of an approximating spline through a hand's (k, 3)
    points.

    The points are few and each has an error of the hand: the spline may miss them by
    ``tolerance_m`` (root mean square). Raises StrokeError for less than two different points.
    """
    points = np.asarray(points_m, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise StrokeError("a stroke is a list of finite x, y, z")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate(([True], steps > _COMB_M))] if len(points) else points
    if len(points) < 2:
        raise StrokeError("a stroke needs two different points")
    count = int(np.clip(arc_lengths(points)[-1] / step_m, 8, _MOST_SAMPLES))
    if len(points) < 4:
        return resample(points, count)
    spline, _ = make_splprep(list(points.T), s=len(points) * tolerance_m**2)
    return resample(np.asarray(spline(np.linspace(0, 1, 8 * count))).T, count)


def in_robot_frame(points_m: FloatArray, T_robot_tracker: FloatArray) -> FloatArray:
    """(n, 3) points of the tracker's frame in the robot's: the inverse of the thesis's tTr."""
    out: FloatArray = points_m @ T_robot_tracker[:3, :3].T + T_robot_tracker[:3, 3]
    return out


def project_stroke(points_m: FloatArray, camera: Camera) -> ProjectedStroke:
    """Eq. 2.4 for (n, 3) samples, lens distortion included."""
    depth = camera.in_camera(points_m)[:, 2]
    xy = camera.project_to_picture(points_m)
    size = np.array([camera.intrinsics.width, camera.intrinsics.height]) - 1
    with np.errstate(invalid="ignore"):
        near = np.all((xy >= -_NEAR_PX) & (xy <= size + _NEAR_PX), axis=1)
        inside = np.all((xy >= 0) & (xy <= size), axis=1)
    xy[~near] = np.nan
    return ProjectedStroke(xy, depth, inside)


def stretches(inside: BoolArray, least: int = 4) -> list[slice]:
    """The runs of samples in the picture, as slices; runs of fewer than ``least`` are left out."""
    return [slice(start, stop) for start, stop in runs(inside) if stop - start >= least]
