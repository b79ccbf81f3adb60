"""One labelled picture from a generator: background, clutter, cables, things on top, camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.cables import paint_cable, random_color, random_light, random_look
from models.synthesis.canvas import Canvas
from models.synthesis.clutter import Style, occluder, paint_clutter, terminal
from models.synthesis.curves import FloatArray, parallel_curve, random_curve
from models.synthesis.optics import photograph
from models.synthesis.textures import TexturePool


@dataclass(frozen=True)
class SceneParams:
    """``size`` (height, width) px; ``width_share`` bounds of a cable's width over the picture's width (6 to
    60 px at 640); ``max_cables``; ``empty_share`` pictures without any; ``clutter`` how often there is some, and
    of which ``style``."""

    size: tuple[int, int] = (192, 320)
    width_share: tuple[float, float] = (0.008, 0.085)
    max_cables: int = 6
    empty_share: float = 0.1
    clutter: float = 0.8
    style: Style = "mixed"


@dataclass(frozen=True)
class Labelled:
    """``rgb`` (3, H, W) float 0 to 1; ``ids`` (H, W) int16, 0 background, k the k-th cable where it is seen;
    ``centerlines`` per cable (m, 3) x, y, height; ``widths_px`` per cable."""

    rgb: Tensor
    ids: Tensor
    centerlines: tuple[FloatArray, ...]
    widths_px: tuple[float, ...]


def render_scene(
    rng: np.random.Generator, params: SceneParams, pool: TexturePool, device: torch.device | None = None
) -> Labelled:
    """Everything random comes from ``rng``: the same generator state gives the same picture."""
    device = device or torch.device("cpu")
    canvas = Canvas(pool.sample(rng, params.size, device).contiguous())
    if rng.random() < params.clutter:
        paint_clutter(canvas, rng, params.style)
    curves, widths = _cables(rng, params)
    # Colors are often the background's own: contrast is not what makes a cable.
    colors = _colors(rng, len(curves), canvas)
    light = random_light(rng)
    for k, (curve, width, color) in enumerate(zip(curves, widths, colors, strict=True), start=1):
        half = np.full(len(curve), width / 2, np.float32)
        paint_cable(canvas, curve, half, random_look(rng, color, width), light, k, rng)
        _finish_ends(canvas, rng, curve, width)
    if rng.random() < 0.12:
        occluder(canvas, rng)
    return Labelled(photograph(canvas.rgb, rng), canvas.ids, tuple(curves), tuple(widths))


def to_uint8(rgb: Tensor) -> NDArray[np.uint8]:
    """(3, H, W) float to (H, W, 3) uint8."""
    return np.asarray((rgb.clamp(0, 1) * 255).round().byte().permute(1, 2, 0).cpu().numpy())


def _cables(rng: np.random.Generator, params: SceneParams) -> tuple[list[FloatArray], list[float]]:
    if rng.random() < params.empty_share:
        return [], []
    low, high = np.log(params.width_share)
    typical = float(np.exp(rng.uniform(low, high)))
    curves: list[FloatArray] = []
    widths: list[float] = []
    for _ in range(rng.integers(1, params.max_cables + 1)):
        share = np.clip(typical * np.exp(rng.normal(0.0, 0.25)), *params.width_share)
        width = float(share * params.size[1])
        if curves and rng.random() < 0.15:
            gap = (width + widths[-1]) / 2 * rng.uniform(1.0, 1.8) * rng.choice([-1, 1])
            curves.append(parallel_curve(rng, curves[-1], gap))
        else:
            curves.append(random_curve(rng, params.size, width))
        widths.append(width)
    return curves, widths


def _colors(rng: np.random.Generator, n: int, canvas: Canvas) -> list[tuple[float, float, float]]:
    identical = random_color(rng) if rng.random() < 0.3 else None
    colors = []
    for _ in range(n):
        color = identical or random_color(rng)
        if rng.random() < 0.15:
            y, x = rng.integers(canvas.height), rng.integers(canvas.width)
            seen = canvas.rgb[:, y, x].cpu().numpy()
            red, green, blue = np.clip(seen + rng.normal(0, 0.04, 3), 0, 1).tolist()
            color = (red, green, blue)
        colors.append(color)
    return colors


def _finish_ends(canvas: Canvas, rng: np.random.Generator, curve: FloatArray, width: float) -> None:
    for end, inner in ((curve[0], curve[6]), (curve[-1], curve[-7])) if len(curve) > 12 else ():
        inside = 0 <= end[0] < canvas.width and 0 <= end[1] < canvas.height
        if inside and rng.random() < 0.4:
            heading = float(np.arctan2(end[1] - inner[1], end[0] - inner[0]))
            terminal(canvas, rng, end[:2], heading, width / 2)
