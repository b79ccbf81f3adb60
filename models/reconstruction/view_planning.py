"""Where to take the next pictures from (thesis section 4.5.4, eq. 4.2 to 4.4).

Strategy: the camera keeps looking in its direction, turns so that the DLO runs down the picture,
and slides along its own x axis, symmetrically over the middle of the DLO. For a change of distance
dz, eq. 4.3 and 4.4 (all points stay ``margin_px`` inside both outer pictures) are linear in the
baseline b, so the largest b they allow is a minimum over the points, and the error of eq. 4.2, mean
(z + dz)^2 / (b f), falls with b: it remains to search dz in its bounds. (Eq. 4.3 is printed with
the sign of sigma turned; here both follow from the projection.) Points that leave the picture along
the DLO do not bind: moving closer trades length for accuracy, and tracking makes up for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.cameras import NEAREST_M, Camera
from models.reconstruction.curves import Curve

Optimise = Literal["fixed", "b", "z", "bz"]

_SINGLE_CAMERA_NOISE_PX = 0.2
"""Effective noise of a point of a refined curve, where the cameras it came from are not given."""

_LEAST_BASELINE_M = 1e-5
_FAN = 0.5
"""Tangent of the angle to either side in which a DLO may go on: the pictures have to show all of
it."""


class NoView(ValueError):
    """No pose within the limits sees enough of the DLO."""


@dataclass(frozen=True)
class PlanParams:
    """``views`` pictures; ``baseline_m`` where it is not optimised (first to last), and at most;
    ``nearest_m`` z_min; ``delta_z_m`` its range; ``margin_px`` sigma; ``overlap`` n_o when the scan
    moves on. ``least_visible``: share of the points that must stay in all pictures."""

    views: int = 3
    optimise: Optimise = "bz"
    baseline_m: float = 0.05
    baseline_at_most_m: float = 1.0
    nearest_m: float = 0.1
    delta_z_m: tuple[float, float] = (-0.5, 0.5)
    margin_px: float = 20.0
    overlap: float = 0.5
    least_visible: float = 0.3


@dataclass(frozen=True, eq=False)
class Plan:
    """``poses`` one a picture; ``sigma_m`` mean of the curve now, ``expected_sigma_m`` from these
    pictures alone; ``visible`` share of the points in all of them."""

    baseline_m: float
    delta_z_m: float
    poses: list[FloatArray]
    sigma_m: float
    expected_sigma_m: float
    visible: float

    @property
    def gain(self) -> float:
        return 1 - self.expected_sigma_m / max(self.sigma_m, 1e-12)


def plan_views(
    curve: Curve, cameras: list[Camera], params: PlanParams, advance: bool = False
) -> Plan:
    """``cameras``: those the curve was seen with, the last one where the camera stands now.
    ``advance``: look at what follows the end of the curve. Raises NoView."""
    now = cameras[-1]
    points, axis = curve.points_m, _main_direction(curve.points_m)
    if advance:
        points, axis = _ahead(curve, now, params)
    facing = _facing(now, points, axis)
    local = facing.in_camera(points)
    if (local[:, 2] <= NEAREST_M).any():
        raise NoView("the DLO lies behind the camera")
    delta_z, baseline, inside = _best(local, facing, params)
    poses = [
        _moved(facing, x, -delta_z) for x in np.linspace(-baseline / 2, baseline / 2, params.views)
    ]
    planned = [replace(now, T_world_camera=pose) for pose in poses]
    sigma = float(curve.sigma_m.mean())
    scale = (
        sigma / _single_point_sigma(curve.points_m, cameras)
        if len(cameras) > 1
        else _SINGLE_CAMERA_NOISE_PX
    )
    expected = scale * _single_point_sigma(points[inside], planned)
    return Plan(baseline, delta_z, poses, sigma, expected, float(inside.mean()))


def depth_error(
    depth_m: FloatArray, baseline_m: float, focal_px: float, disparity_px: float = 1.0
) -> float:
    """Mean error of depth for an error of disparity (eq. 4.2)."""
    return float(np.mean(depth_m**2) / (baseline_m * focal_px) * disparity_px)


def _best(local: FloatArray, camera: Camera, params: PlanParams) -> tuple[float, float, BoolArray]:
    """Change of distance, baseline, and which points (n,) stay in all pictures."""
    free_z = params.optimise in ("z", "bz")
    low = max(params.delta_z_m[0], params.nearest_m - float(local[:, 2].min()))
    high = params.delta_z_m[1]
    best: tuple[float, float, float, BoolArray] | None = None
    for delta in np.linspace(low, high, 241) if free_z and low < high else [max(low, 0.0)]:
        seen, room = _room(local, camera, float(delta), params)
        if seen.mean() < params.least_visible:
            continue
        limit = min(float(room[seen].min()), params.baseline_at_most_m)
        baseline = limit if params.optimise in ("b", "bz") else params.baseline_m
        if not _LEAST_BASELINE_M <= baseline <= limit:
            continue
        error = depth_error(local[seen, 2] + delta, baseline, camera.focal_px)
        if best is None or error < best[0]:
            best = (error, float(delta), baseline, seen)
    if best is None:
        raise NoView("no baseline and distance within the limits keeps the DLO in all pictures")
    return best[1:]


def _room(
    local: FloatArray, camera: Camera, delta: float, params: PlanParams
) -> tuple[BoolArray, FloatArray]:
    """Which points are in the picture along its height, and the baseline at which each leaves it
    sideways."""
    i = camera.intrinsics
    depth = local[:, 2] + delta
    y = local[:, 1] / depth * i.fy + i.cy
    seen = (depth > 0) & (y >= params.margin_px) & (y <= i.height - 1 - params.margin_px)
    # p_x + f (b / 2) / z within [sigma, w - sigma], for the first and for the last picture
    right = (i.width - 1 - params.margin_px - i.cx) * depth / i.fx - local[:, 0]
    left = (i.cx - params.margin_px) * depth / i.fx + local[:, 0]
    return seen, 2 * np.minimum(left, right)


def _facing(camera: Camera, points: FloatArray, axis: FloatArray) -> Camera:
    """The camera at its distance, centered over the points, turned about its view so that ``axis``
    runs down (or up, whichever is the smaller turn)."""
    forward = camera.rotation[:, 2]
    down = axis - forward * (axis @ forward)
    if np.linalg.norm(down) < 0.2:
        down = camera.rotation[:, 1]
    down = down / np.linalg.norm(down)
    if down @ camera.rotation[:, 1] < 0:
        down = -down
    rotation = np.stack([np.cross(down, forward), down, forward], axis=1)
    extent = (points - camera.center) @ rotation
    middle = (extent.min(axis=0) + extent.max(axis=0)) / 2
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = camera.center + rotation[:, :2] @ middle[:2]
    return replace(camera, T_world_camera=pose)


def _moved(camera: Camera, x: float, z: float) -> FloatArray:
    pose = camera.T_world_camera.copy()
    pose[:3, 3] += camera.rotation @ np.array([x, 0.0, z])
    return pose


def _main_direction(points: FloatArray) -> FloatArray:
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return np.asarray(axes[0])


def _ahead(curve: Curve, camera: Camera, params: PlanParams) -> tuple[FloatArray, FloatArray]:
    """Points of the end of the curve and of where it may go on, such that ``overlap`` of the
    picture is known."""
    end = curve.points_m[-1]
    depth = float(camera.in_camera(end[None])[0, 2])
    reach = camera.intrinsics.height * depth / camera.intrinsics.fy
    known = curve.points_m[
        np.linalg.norm(curve.points_m - end, axis=1) < max(params.overlap, 0.2) * reach
    ]
    direction = end - known[0] if len(known) > 1 else curve.spline.tangents(np.array([1.0]))[0]
    forward = camera.rotation[:, 2]
    direction = direction - forward * (direction @ forward)
    direction /= max(float(np.linalg.norm(direction)), 1e-9)
    aside = np.cross(forward, direction)
    steps = np.linspace(0, 1, 20)[1:] * (1 - params.overlap) * reach
    fan = [end + steps[:, None] * (direction + turn * aside) for turn in (0.0, _FAN, -_FAN)]
    return np.concatenate([known, *fan]), direction


def _single_point_sigma(points: FloatArray, cameras: list[Camera]) -> float:
    """Mean over the points of the worst standard deviation of a point seen with a noise of one
    pixel."""
    information = np.zeros((len(points), 3, 3))
    for camera in cameras:
        ray = points - camera.center
        distance = np.maximum(np.linalg.norm(ray, axis=1), NEAREST_M)
        unit = ray / distance[:, None]
        keep = np.eye(3) - unit[:, :, None] * unit[:, None]
        information += (camera.focal_px / distance)[:, None, None] ** 2 * keep
    weakest = np.linalg.eigvalsh(information)[:, 0]
    return float(np.mean(1 / np.sqrt(np.maximum(weakest, 1e-12))))
