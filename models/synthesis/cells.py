"""A camera over one place: the place empty, and later with cables, in another light, under an arm's
shadow.

The place is painted once, larger than the picture; the empty picture is a cut of it that is turned
and shifted a little, as a camera moves on its mount, and each picture is taken by a camera of its
own mood (``optics``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch

from models.geometry.arrays import BoolArray, ByteArray, Float32Array
from models.synthesis.bundles import random_layout
from models.synthesis.cables import paint_cables
from models.synthesis.canvas import Canvas
from models.synthesis.clutter import paint_clutter
from models.synthesis.looks import random_light
from models.synthesis.optics import photograph
from models.synthesis.scenes import SceneParams, random_cables, to_uint8
from models.synthesis.textures import TexturePool

_MARGIN_PX = 24
_SHIFT_PX, _TURN_RAD = 3.0, 0.004
"""Standard deviations of what the camera moved by."""
_SHADOW_SHARE = 0.6

Rng = np.random.Generator


@dataclass(frozen=True)
class Cell:
    """``picture`` (H, W, 3) and its ``mask`` (H, W) of cables; ``places`` (H, W, 3) each, the empty
    place."""

    picture: ByteArray
    mask: BoolArray
    places: tuple[ByteArray, ...]


def render_cell(rng: Rng, params: SceneParams, pool: TexturePool, places: int = 1) -> Cell:
    """One place of ``params.style`` with at least one cable; ``places`` pictures of it empty."""
    height, width = params.size
    outer = height + 2 * _MARGIN_PX, width + 2 * _MARGIN_PX
    canvas = Canvas(pool.sample(rng, outer, torch.device("cpu")).contiguous())
    paint_clutter(canvas, rng, params.style)
    ground = canvas.rgb.clone()
    share = (params.width_share[0] * width / outer[1], params.width_share[1] * width / outer[1])
    layout = random_layout(rng, outer, share, params.max_cables)
    paint_cables(
        canvas,
        random_cables(rng, layout, canvas.rgb, alike=rng.random() < 0.2),
        random_light(rng),
        rng,
    )
    inner = (slice(_MARGIN_PX, -_MARGIN_PX), slice(_MARGIN_PX, -_MARGIN_PX))
    mask = (canvas.ids[inner] > 0).numpy()
    if not mask.any():
        return render_cell(rng, replace(params, empty_share=0.0), pool, places)
    lit = _seen(_array(canvas.rgb)[inner], rng, _SHADOW_SHARE)
    empty = tuple(_seen(_moved(_array(ground), rng)[inner], rng, 0.3) for _ in range(places))
    return Cell(lit, mask, empty)


def _array(rgb: torch.Tensor) -> Float32Array:
    return np.ascontiguousarray(rgb.permute(1, 2, 0).numpy())


def _moved(ground: Float32Array, rng: Rng) -> Float32Array:
    height, width = ground.shape[:2]
    warp = cv2.getRotationMatrix2D(
        (width / 2, height / 2), float(np.degrees(rng.normal(0, _TURN_RAD))), 1.0
    )
    warp[:, 2] += np.clip(rng.normal(0, _SHIFT_PX, 2), -_MARGIN_PX / 2, _MARGIN_PX / 2)
    return np.asarray(
        cv2.warpAffine(ground, warp, (width, height), borderMode=cv2.BORDER_REFLECT_101)
    )


def _seen(ground: Float32Array, rng: Rng, shadow_share: float) -> ByteArray:
    """In a light of its own, now and then with an arm's shadow, by a camera."""
    light = np.exp(rng.normal(0, 0.12) + rng.normal(0, 0.04, 3)).astype(np.float32)
    out = ground * light
    if rng.random() < shadow_share:
        out = out * _shadow(out.shape[:2], rng)[:, :, None]
    tensor = torch.from_numpy(np.ascontiguousarray(out.clip(0, 1).transpose(2, 0, 1)))
    return to_uint8(photograph(tensor, rng))


def _shadow(size: tuple[int, ...], rng: Rng) -> Float32Array:
    """(H, W) of an arm of two links that reaches in from beside the picture; soft at its edges."""
    height, width = size[0], size[1]
    drawn = np.zeros((height, width), np.uint8)
    half = rng.uniform(0.06, 0.16) * width
    at = np.array([width / 2, height / 2]) + 0.7 * width * _direction(rng)
    for end in (rng.uniform((0, 0), (width, height)), rng.uniform((0, 0), (width, height))):
        a, b = ((round(float(x)), round(float(y))) for x, y in (at, end))
        cv2.line(drawn, a, b, 255, max(1, round(2 * half)))
        at, half = end, 0.7 * half
    soft = cv2.GaussianBlur(drawn, (0, 0), float(rng.uniform(1.5, 9.0))).astype(np.float32) / 255
    return np.asarray(1 - rng.uniform(0.2, 0.55) * soft, np.float32)


def _direction(rng: Rng) -> np.ndarray:
    angle = rng.uniform(-np.pi, np.pi)
    return np.array([np.cos(angle), np.sin(angle)])
