"""Round cables in the air over and on a table, ray by ray: true depth, mask and centerlines in
meters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, Float32Array, FloatArray
from models.geometry.cameras import Camera, Intrinsics, look_at
from models.geometry.polylines import resample

Rng = np.random.Generator
_SPACING_M = 0.0004


@dataclass(frozen=True)
class DepthSceneParams:
    """``cables`` of ``radius_m`` on a table ``distance_m`` away, seen ``tilt_rad`` off its normal
    with ``focal_px``; where two cross, the upper one is lifted over the lower one."""

    size: tuple[int, int] = (480, 640)
    focal_px: float = 600.0
    distance_m: float = 0.6
    tilt_rad: float = 0.2
    cables: int = 3
    radius_m: float = 0.00175


@dataclass(frozen=True, eq=False)
class DepthScene:
    """``depth_m`` (H, W) true; ``owner`` (H, W) 0 table, k the k-th cable; ``curves_m`` axes (n, 3)
    in the camera's frame; ``table`` normal (3,) and offset, as of
    :class:`models.depth.table.Table`."""

    camera: Camera
    depth_m: Float32Array
    owner: np.ndarray
    curves_m: tuple[FloatArray, ...]
    table: tuple[FloatArray, float]

    @property
    def mask(self) -> BoolArray:
        return np.asarray(self.owner > 0)


def depth_scene(rng: Rng, params: DepthSceneParams) -> DepthScene:
    """Everything random comes from ``rng``. Strategy: an axis is many balls; of each the upper side
    is drawn, and the nearest counts."""
    height, width = params.size
    intrinsics = Intrinsics(
        width, height, params.focal_px, params.focal_px, (width - 1) / 2, (height - 1) / 2
    )
    center = params.distance_m * np.array([np.sin(params.tilt_rad), 0.0, np.cos(params.tilt_rad)])
    placed = Camera(intrinsics, look_at(center, np.zeros(3), np.array([0.0, -1.0, 0.0])))
    camera = Camera(intrinsics, np.eye(4))
    reach = 0.4 * params.distance_m * height / params.focal_px
    flat = [_flat(rng, reach) for _ in range(params.cables)]
    curves = [placed.in_camera(curve) for curve in _stacked(flat, params.radius_m)]
    normal = placed.in_camera(placed.center + np.array([0.0, 0.0, 1.0]))
    offset = float(normal @ placed.in_camera(np.zeros(3)))
    depth, owner = _drawn(curves, params.radius_m, camera, normal, offset)
    return DepthScene(camera, depth, owner, tuple(curves), (normal, offset))


def _flat(rng: Rng, reach: float) -> FloatArray:
    """(n, 2) a curve through the middle of the table."""
    angle = rng.uniform(0, 2 * np.pi)
    u = np.linspace(-1, 1, 400)
    along = reach * u
    across = sum(
        rng.normal(0, 0.15 / k) * reach * np.sin(np.pi * k * u + rng.uniform(0, 6))
        for k in (1, 2, 3)
    )
    across = np.asarray(across) + rng.uniform(-0.4, 0.4) * reach
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    line = np.column_stack([along, across]) @ turn.T
    length = float(np.hypot(*np.diff(line, axis=0).T).sum())
    return resample(line, int(length / _SPACING_M))


def _stacked(flat: list[FloatArray], radius: float) -> list[FloatArray]:
    """(n, 3) axes at ``radius`` above the table, lifted smoothly over the cables below."""
    out: list[FloatArray] = []
    for line in flat:
        z = np.full(len(line), radius)
        for below in out:
            away = np.hypot(*(line[:, None, :] - below[None, ::5, :2]).transpose(2, 0, 1))
            nearest = away.argmin(1)
            lift = below[::5, 2][nearest] + 2.05 * radius
            share = np.clip(1.6 - away.min(1) / (5 * radius), 0, 1)
            z = np.maximum(z, radius + (lift - radius) * share**2 * (3 - 2 * share))
        out.append(np.column_stack([line, z]))
    return out


def _drawn(
    curves: list[FloatArray], radius: float, camera: Camera, normal: FloatArray, offset: float
) -> tuple[Float32Array, np.ndarray]:
    height, width = camera.intrinsics.height, camera.intrinsics.width
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    rays = camera.rays(np.stack([columns, rows], axis=-1))
    depth = offset / (rays @ normal)
    owner = np.zeros((height, width), np.uint8)
    side = np.arange(
        -(r := int(np.ceil(radius * camera.focal_px / curves[0][:, 2].min())) + 2), r + 1
    )
    offsets = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    for number, curve in enumerate(curves, start=1):
        pixels = np.rint(camera.project(curve)).astype(int)[:, None] + offsets
        inside = ((pixels >= 0) & (pixels < (width, height))).all(-1)
        ball = np.broadcast_to(np.arange(len(curve))[:, None], inside.shape)[inside]
        x, y = pixels[inside].T
        ray = rays[y, x]
        along = (ray * curve[ball]).sum(1) / (ray**2).sum(1)
        miss = ((ray * along[:, None] - curve[ball]) ** 2).sum(1)
        hit = miss < radius**2
        near = along[hit] - np.sqrt((radius**2 - miss[hit]) / (ray[hit] ** 2).sum(1))
        x, y = x[hit], y[hit]
        nearest = np.full(depth.shape, np.inf)
        np.minimum.at(nearest, (y, x), near)
        upper = nearest < depth
        depth[upper], owner[upper] = nearest[upper], number
    return depth.astype(np.float32), owner
