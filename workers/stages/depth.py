"""The depth beside a picture: read, its table found, and what it shows of foreground, order and
curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import CameraPose, DepthGiven, PinholeIntrinsics, TablePlane
from dlo_client.contracts.cameras import AnyIntrinsics, Pose
from numpy.typing import NDArray

from models.depth.clouds import off_px, pinhole_of
from models.depth.curves import MetricCurve, metric_curve
from models.depth.evidence import log_odds
from models.depth.table import Table, find_table, heights
from models.geometry.cameras import Camera
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import read_cloud_m, read_depth_m

_SEED = 7
_HERE: Pose = (
    (1.0, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),
    (0.0, 0.0, 0.0, 1.0),
)
_USUAL_SIGMA_M = 0.001
"""Of a depth whose noise no table shows."""
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_MICROMETERS = 6
_MOST_OFF_PX = 1.0
"""By which the points of a cloud may be off their pixels; an undistorted picture that was rectified
otherwise is off by more."""
_IN_FRAME = (
    "whose points should be in the camera's frame (x right, y down, z forward), "
    "one for each pixel of the picture"
)


@dataclass(frozen=True)
class SeenDepth:
    """``depth_m`` (H, W), NaN unknown; ``camera`` where its intrinsics were given; ``table`` where
    there is one, then also ``odds`` (H, W), log odds of a cable by height."""

    depth_m: NDArray[np.float32]
    camera: Camera | None
    table: Table | None
    odds: NDArray[np.float32] | None
    remarks: list[str]

    @property
    def sigma_m(self) -> float:
        return self.table.sigma_m if self.table else _USUAL_SIGMA_M


def read_depth(request: DepthGiven, tools: Tools) -> SeenDepth | None:
    """The depth of a request, if it has one. Raises InvalidInput naming the field."""
    if request.depth is None:
        return None
    points = read_cloud_m(request.depth, "depth", tools)
    depth = read_depth_m(request.depth, "depth", tools) if points is None else points[..., 2]
    given = request.intrinsics if points is None else request.intrinsics or _of_cloud(points)
    if given is None:
        return SeenDepth(depth, None, None, None, [])
    camera = _camera(request, given, depth.shape)
    if points is not None:
        _check_cloud(points, camera)
    table = find_table(depth, camera, np.random.default_rng(_SEED))
    if table is None:
        return SeenDepth(
            depth, camera, None, None, ["depth: no table was found in it; heights were not used"]
        )
    return SeenDepth(depth, camera, table, log_odds(heights(depth, camera, table), table), [])


def plane(seen: SeenDepth | None) -> TablePlane | None:
    if seen is None or seen.table is None:
        return None
    x, y, z = np.round(seen.table.normal, 6).tolist()
    return TablePlane(
        normal=(x, y, z),
        offset_m=round(seen.table.offset_m, _MICROMETERS),
        sigma_m=float(f"{seen.table.sigma_m:.4g}"),
        share=round(seen.table.share, 4),
    )


def curve_fields(
    seen: SeenDepth | None,
    xy: NDArray[np.float64],
    width_px: float,
    covered: Sequence[tuple[float, float]],
    count: int,
) -> dict[str, object]:
    """The fields of a MetricCenterline for a centerline ``xy`` (n, 2) answered with ``count``
    points."""
    if seen is None or seen.camera is None or len(xy) < 2:
        return {}
    curve = metric_curve(xy, width_px, seen.depth_m, seen.camera, seen.sigma_m, covered, count)
    return {} if curve is None else _fields(curve)


def _fields(curve: MetricCurve) -> dict[str, object]:
    return {
        "curve_m": [tuple(point) for point in np.round(curve.points_m, _MICROMETERS).tolist()],
        "radius_m": round(curve.radius_m, _MICROMETERS),
        "sigma_m": [float(f"{sigma:.4g}") for sigma in curve.sigma_m],
        "covariance_m2": [
            tuple(float(f"{c[i, j]:.4g}") for i, j in _UPPER) for c in curve.covariance_m2
        ],
    }


def _of_cloud(points: NDArray[np.float32]) -> PinholeIntrinsics:
    """The camera that took an organised point cloud. Raises InvalidInput."""
    found = pinhole_of(points)
    if found is None or found.off_px > _MOST_OFF_PX:
        raise InvalidInput(
            "depth", f"is a point cloud {_IN_FRAME}, or give `intrinsics`", "invalid_depth"
        )
    height, width = points.shape[:2]
    return PinholeIntrinsics(
        width=width, height=height, fx=found.fx, fy=found.fy, cx=found.cx, cy=found.cy
    )


def _check_cloud(points: NDArray[np.float32], camera: Camera) -> None:
    """Raises InvalidInput where its points are not those of the camera's pixels."""
    off = off_px(points, camera)
    if off > _MOST_OFF_PX:
        away = (
            f"its points are {off:.1f} pixels off what `intrinsics` tell"
            if np.isfinite(off)
            else "it has no points"
        )
        raise InvalidInput("depth", f"is a point cloud {_IN_FRAME}: {away}", "invalid_depth")


def _camera(request: DepthGiven, given: AnyIntrinsics, shape: tuple[int, ...]) -> Camera:
    width, height = given.picture_size
    if (height, width) != shape:
        message = f"are of a picture of {width} × {height} pixels, but the depth has {shape[1]} × {shape[0]}"
        raise InvalidInput("intrinsics", message, "size_mismatch")
    return curves3d.camera(
        CameraPose(intrinsics=given, T_world_camera=request.T_world_camera or _HERE), "intrinsics"
    )
