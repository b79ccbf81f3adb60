"""What a DLO looks like, and painting it with its shadow over a canvas."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.canvas import Canvas, blur, shift
from models.synthesis.ribbons import Ribbon, rasterize, strands

# Hue, saturation and value bands of common insulation colors; drawn with equal chance.
_PALETTE = (
    ((0.55, 0.63), (0.7, 1.0), (0.35, 0.9)),  # blue
    ((0.54, 0.60), (0.15, 0.5), (0.7, 1.0)),  # light blue
    ((0.97, 1.02), (0.7, 1.0), (0.4, 0.9)),  # red
    ((0.13, 0.17), (0.6, 1.0), (0.7, 1.0)),  # yellow
    ((0.03, 0.09), (0.6, 1.0), (0.6, 1.0)),  # orange
    ((0.05, 0.10), (0.4, 0.8), (0.25, 0.6)),  # brown, copper
    ((0.25, 0.42), (0.4, 1.0), (0.25, 0.85)),  # green
    ((0.0, 1.0), (0.0, 0.12), (0.75, 1.0)),  # white
    ((0.0, 1.0), (0.0, 0.2), (0.3, 0.7)),  # grey
    ((0.0, 1.0), (0.0, 0.3), (0.03, 0.2)),  # black
    ((0.0, 1.0), (0.0, 1.0), (0.1, 1.0)),  # anything
)


@dataclass(frozen=True)
class Light:
    """``direction`` (3,) unit vector to the lamp, ``ambient`` 0 (one hard lamp) to 1 (flat), ``color`` (3,)."""

    direction: tuple[float, float, float]
    ambient: float
    shadow: float
    softness: int
    color: tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Surface of one DLO: base and second color, the pattern they form, gloss, roughness of the surface."""

    color: tuple[float, float, float]
    second: tuple[float, float, float]
    pattern: str  # plain, stripe, helix, bands, print
    period_px: float
    gloss: float
    shininess: float
    grain: float
    opacity: float


def random_color(rng: np.random.Generator) -> tuple[float, float, float]:
    hue, saturation, value = (rng.uniform(*band) for band in _PALETTE[rng.integers(len(_PALETTE))])
    return colorsys.hsv_to_rgb(hue % 1.0, saturation, value)


def random_look(rng: np.random.Generator, color: tuple[float, float, float], width_px: float) -> Look:
    pattern = rng.choice(["plain", "stripe", "helix", "bands", "print"], p=[0.72, 0.07, 0.07, 0.05, 0.09])
    return Look(
        color=color,
        second=random_color(rng),
        pattern=str(pattern),
        period_px=float(width_px * rng.uniform(1.5, 8.0)),
        gloss=float(rng.choice([0.0, rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.9)])),
        shininess=float(rng.uniform(4, 40)),
        grain=float(rng.choice([0.0, rng.uniform(0.0, 0.12)])),
        opacity=float(rng.uniform(0.55, 0.9)) if rng.random() < 0.03 else 1.0,
    )


def random_light(rng: np.random.Generator) -> Light:
    azimuth, tilt = rng.uniform(-np.pi, np.pi), rng.uniform(0.15, 1.1)
    warmth = rng.normal(0.0, 0.06)
    ambient = float(rng.choice([rng.uniform(0.25, 0.6), rng.uniform(0.6, 0.9), rng.uniform(0.9, 1.0)]))
    return Light(
        direction=(float(np.sin(tilt) * np.cos(azimuth)), float(np.sin(tilt) * np.sin(azimuth)), float(np.cos(tilt))),
        ambient=ambient,
        shadow=float(rng.uniform(0.05, 0.75) * (1.15 - ambient)),
        softness=int(rng.integers(0, 6)),
        color=(1 + warmth, 1.0, 1 - warmth),
    )  # fmt: skip


def paint_cable(
    canvas: Canvas,
    curve: NDArray[np.float32],
    half_width: NDArray[np.float32],
    look: Look,
    light: Light,
    instance: int,
    rng: np.random.Generator,
) -> None:
    """Shadow first, then the strands from the lowest to the highest. ``instance`` 0 paints a distractor
    (in one go: how it crosses itself does not matter)."""
    whole = rasterize(curve, half_width, canvas.size, canvas.rgb.device)
    if len(whole.index) == 0:
        return
    _cast_shadow(canvas, whole, light, float(half_width.mean()), rng)
    if not instance:
        _paint_strand(canvas, whole, look, light, 0, 0, rng)
        return
    pieces = max(int(len(curve) * 0.7 / (8 * float(half_width.max()) + 12)), 1)
    for run in strands(curve, min(pieces, 16)):
        ribbon = rasterize(curve[run], half_width[run], canvas.size, canvas.rgb.device)
        _paint_strand(canvas, ribbon, look, light, instance, int(run[0]), rng)


def _cast_shadow(canvas: Canvas, ribbon: Ribbon, light: Light, half: float, rng: np.random.Generator) -> None:
    if light.shadow < 0.04:
        return
    cover = torch.zeros(canvas.height * canvas.width, device=canvas.rgb.device)
    cover[ribbon.index] = ribbon.alpha
    reach = half * (0.3 + rng.uniform(0.0, 2.2))
    dx, dy = (-round(reach * light.direction[i] * 1.5) for i in (0, 1))
    soft = light.softness + int(0.15 * reach)
    canvas.darken(shift(blur(cover.view(canvas.size), soft), dx, dy), light.shadow)


def _paint_strand(
    canvas: Canvas, ribbon: Ribbon, look: Look, light: Light, instance: int, first: int, rng: np.random.Generator
) -> None:  # fmt: skip
    if len(ribbon.index) == 0:
        return
    color = _albedo(ribbon, look, first) * _shade(ribbon, look, light)
    if look.grain > 0:
        noise = torch.as_tensor(rng.normal(0, look.grain, len(ribbon.index)).astype(np.float32))
        color = color * (1 + noise.to(color.device))[:, None]
    color = color + look.gloss * _highlight(ribbon, look, light)[:, None]
    flat = canvas.rgb.view(3, -1)
    alpha = ribbon.alpha * look.opacity
    below = flat[:, ribbon.index]
    flat[:, ribbon.index] = below + alpha * (
        color.T * torch.tensor(light.color, device=flat.device, dtype=torch.float32)[:, None] - below
    )
    ids = canvas.ids.view(-1)
    ids[ribbon.index[ribbon.alpha > 0.5]] = instance


def _albedo(ribbon: Ribbon, look: Look, first: int) -> Tensor:
    """(P, 3) surface color before light."""
    device = ribbon.offset.device
    base, second = (torch.tensor(c, device=device, dtype=torch.float32) for c in (look.color, look.second))
    along = (ribbon.sample + first) * 0.7 / look.period_px
    angle = torch.asin(ribbon.offset)
    if look.pattern == "stripe":
        mixed = (ribbon.offset.abs() < 0.3).float()
    elif look.pattern == "helix":
        mixed = (torch.sin(2 * torch.pi * along + angle) > 0.3).float()
    elif look.pattern == "bands":
        mixed = (torch.sin(2 * torch.pi * along) > 0.6).float()
    elif look.pattern == "print":
        mixed = ((torch.sin(9 * along) + torch.sin(23 * along) > 0.4) & (ribbon.offset.abs() < 0.35)).float() * 0.7
    else:
        return base.expand(len(ribbon.index), 3)
    return base + mixed[:, None] * (second - base)


def _surface_normal(ribbon: Ribbon) -> tuple[Tensor, Tensor]:
    across = ribbon.normal_xy * ribbon.offset[:, None]
    return across, (1 - ribbon.offset**2).clamp(min=0).sqrt()


def _shade(ribbon: Ribbon, look: Look, light: Light) -> Tensor:
    """(P, 1) Lambert term of a cylinder; ``ambient`` 1 leaves only a faint darkening at the rim."""
    across, up = _surface_normal(ribbon)
    lx, ly, lz = light.direction
    lambert = (across[:, 0] * lx + across[:, 1] * ly + up * lz).clamp(min=0)
    rim = 0.85 + 0.15 * up
    return (light.ambient * rim + (1 - light.ambient) * 1.25 * lambert)[:, None]


def _highlight(ribbon: Ribbon, look: Look, light: Light) -> Tensor:
    across, up = _surface_normal(ribbon)
    lx, ly, lz = light.direction
    scale = 1.0 / np.sqrt(lx**2 + ly**2 + (lz + 1) ** 2)
    half = (across[:, 0] * lx + across[:, 1] * ly + up * (lz + 1)) * scale
    return half.clamp(min=0) ** look.shininess
