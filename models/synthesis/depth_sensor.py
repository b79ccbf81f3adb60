"""What a depth camera makes of true depth: noise that is alike in neighboring pixels, holes, flying
pixels.

Structured light and stereo: the noise is smooth over a few pixels; where the surface jumps a pixel
may be missing (the projector's shadow) or fly between both sides; dark or shiny patches have holes;
depths come in steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, Float32Array

Rng = np.random.Generator


@dataclass(frozen=True)
class SensorParams:
    """``sigma_m`` of a pixel's noise, alike over about ``grain_px``; ``holes`` share of the picture
    in patches; ``flying`` share of the pixels at jumps of more than ``jump_m`` that are between
    both sides, ``shadow`` that are missing; ``step_m`` between two depths that it tells apart."""

    sigma_m: float = 0.001
    grain_px: float = 1.2
    holes: float = 0.01
    flying: float = 0.25
    shadow: float = 0.15
    jump_m: float = 0.002
    step_m: float = 0.0001


def sensed(rng: Rng, true_m: Float32Array, params: SensorParams) -> Float32Array:
    """(H, W) meters as the sensor gives them; NaN are holes."""
    size = (true_m.shape[1], true_m.shape[0])
    noise = cv2.GaussianBlur(
        rng.standard_normal(true_m.shape).astype(np.float32), (0, 0), params.grain_px
    )
    depth = true_m + params.sigma_m * noise / max(float(noise.std()), 1e-9)
    low, high = cv2.erode(true_m, np.ones((3, 3))), cv2.dilate(true_m, np.ones((3, 3)))
    jump = (high - low) > params.jump_m
    luck = rng.random(true_m.shape)
    flying = jump & (luck < params.flying)
    depth[flying] = (low + rng.random(true_m.shape) * (high - low))[flying]
    depth[jump & (luck > 1 - params.shadow)] = np.nan
    depth[_patches(rng, size, params.holes)] = np.nan
    return np.asarray(np.round(depth / params.step_m) * params.step_m, np.float32)


def _patches(rng: Rng, size: tuple[int, int], share: float) -> BoolArray:
    """(H, W) round patches that cover about ``share`` of the picture."""
    width, height = size
    mask = np.zeros((height, width), np.uint8)
    left = share * width * height
    while left > 0:
        radius = int(rng.integers(2, 7))
        cv2.circle(mask, (int(rng.integers(0, width)), int(rng.integers(0, height))), radius, 1, -1)
        left -= np.pi * radius**2
    return np.asarray(mask > 0)
