"""Harnesses on a table in color and depth, with the shadows that a lamp makes of them.

Strategy: a harness of :mod:`models.synthesis.harness` is a map of heights: round sections, the
upper one lifted where two cross. Color comes from the heights (shading, cast shadows as dark as the
cables), and depth, through the noise model of a sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from dlo_client.contracts import PinholeIntrinsics
from scipy.ndimage import shift
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.geometry.polylines import arc_lengths
from models.synthesis.depth_sensor import SensorParams, sensed
from models.synthesis.harness import Harness, HarnessParams
from models.synthesis.harness_growth import make_harness
from models.synthesis.textures import TexturePool

_METERS_A_PX, _DISTANCE_M = 0.001, 0.6
_LIFT_WIDTHS = 3.0
"""Over so many widths a section rises to lie upon another one."""
_REACH_PX = 60
"""The longest shadow."""


@dataclass(frozen=True, eq=False)
class HarnessScene:
    """``rgb`` (H, W, 3); ``depth_m`` (H, W) as the sensor gives it; true ``mask`` and ``shadow``
    (H, W)."""

    harness: Harness
    rgb: ByteArray
    depth_m: Float32Array
    mask: BoolArray
    shadow: BoolArray
    intrinsics: PinholeIntrinsics


def harness_scene(
    rng: np.random.Generator, params: HarnessParams, sensor: SensorParams
) -> HarnessScene:
    """Everything random comes from ``rng``."""
    harness = make_harness(rng, params)
    height_px = _heights(harness)
    mask = height_px > 0
    lamp, slope = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.2)
    shadow = _shadow(height_px, lamp, slope)
    rows, columns = params.size
    focal = _DISTANCE_M / _METERS_A_PX
    intrinsics = PinholeIntrinsics(
        width=columns, height=rows, fx=focal, fy=focal, cx=(columns - 1) / 2, cy=(rows - 1) / 2
    )
    tilt = rng.uniform(-0.1, 0.1, 2) * _METERS_A_PX
    across = (np.arange(columns) - intrinsics.cx) * tilt[0]
    down = (np.arange(rows) - intrinsics.cy) * tilt[1]
    depth = (_DISTANCE_M + across + down[:, None] - _METERS_A_PX * height_px).astype(np.float32)
    rgb = _color(rng, height_px, shadow, lamp, slope)
    return HarnessScene(
        harness, rgb, sensed(rng, depth, sensor), mask, (shadow > 0.5) & ~mask, intrinsics
    )


def _heights(harness: Harness) -> FloatArray:
    """(H, W) px of the upper sides above the table; 0 where it is bare."""
    out = np.zeros(harness.size)
    for number, section in enumerate(harness.sections):
        drawn = np.zeros(harness.size, np.uint8)
        cv2.polylines(
            drawn, [np.rint(section.xy).astype(np.int32)], False, 1, int(np.ceil(section.width)) + 2
        )
        y, x = np.nonzero(drawn)
        away, nearest = cKDTree(section.xy).query(np.column_stack([x, y]))
        radius = section.width / 2
        inside = away < radius
        side = np.sqrt(radius**2 - away[inside] ** 2)
        height = radius + side + _lift(harness, number)[nearest[inside]]
        np.maximum.at(out, (y[inside], x[inside]), height)
    return out


def _lift(harness: Harness, number: int) -> FloatArray:
    """(m,) px by which a section is lifted along its centerline."""
    section = harness.sections[number]
    along = arc_lengths(section.xy)
    lift = np.zeros(len(along))
    for crossing, a_over in zip(harness.crossings, harness.a_over, strict=True):
        upper, lower = (crossing.a, crossing.b) if a_over else (crossing.b, crossing.a)
        if upper == number:
            below = harness.sections[lower].width
            at = along[np.hypot(*(section.xy - crossing.xy).T).argmin()]
            flat = 0.5 * below
            share = np.clip(1 - (np.abs(along - at) - flat) / (_LIFT_WIDTHS * below), 0, 1)
            lift = np.maximum(lift, below * share**2 * (3 - 2 * share))
    return lift


def _shadow(height_px: FloatArray, lamp: float, slope: float) -> FloatArray:
    """(H, W) 0 to 1, of a lamp in the direction ``lamp`` whose rays fall ``slope`` px a px."""
    dark = np.zeros_like(height_px)
    for step in range(2, _REACH_PX, 2):
        way = (step * np.sin(lamp), step * np.cos(lamp))
        dark = np.maximum(dark, shift(height_px, way, order=1) - slope * step - height_px > 0.5)
    return np.asarray(cv2.GaussianBlur(dark.astype(np.float32), (0, 0), 1.2), float)


def _color(
    rng: np.random.Generator, height_px: FloatArray, shadow: FloatArray, lamp: float, slope: float
) -> ByteArray:
    ground = (
        TexturePool(()).sample(rng, height_px.shape, torch.device("cpu")).numpy().transpose(1, 2, 0)
    )
    cable = rng.uniform(0.08, 0.35) * rng.uniform(0.8, 1.2, 3)
    mask = cv2.GaussianBlur((height_px > 0).astype(np.float32), (0, 0), 0.6)[..., None]
    rise_y, rise_x = np.gradient(cv2.GaussianBlur(height_px, (0, 0), 0.8))
    normal = np.dstack([-rise_x, -rise_y, np.ones_like(rise_x)])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    light = np.array([-np.cos(lamp), -np.sin(lamp), slope]) / np.hypot(1, slope)
    lit = np.clip(normal @ light, 0, 1) * (1 - shadow)
    seen = ((1 - mask) * ground + mask * cable) * (0.4 + 0.75 * lit / light[2])[..., None]
    noisy = seen + rng.normal(0, 0.01, seen.shape)
    return np.asarray(np.clip(255 * noisy, 0, 255), np.uint8)
