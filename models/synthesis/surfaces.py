"""What a table top shows of itself: joints, tiles, folds, wood grain, shadows of bars, reflected
lamps."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from models.synthesis.canvas import Canvas
from models.synthesis.curves import axes
from models.synthesis.looks import random_gray

Rng = np.random.Generator


def seams(canvas: Canvas, rng: Rng) -> None:
    """Long straight lines and edges: table edges, creases, painted stripes."""
    w = canvas.width
    angle, color = rng.uniform(-np.pi, np.pi), random_gray(rng)
    for _ in range(rng.integers(1, 5)):
        at = rng.uniform((0, 0), (w, canvas.height))
        turn = angle + rng.choice([0.0, np.pi / 2]) + rng.normal(0, 0.05)
        thick = (
            0.5 + rng.uniform(0, 0.005) * w if rng.random() < 0.7 else rng.uniform(0.006, 0.03) * w
        )
        canvas.box(
            at,
            (2 * w, thick),
            turn,
            color,
            opacity=rng.uniform(0.2, 1.0),
            bevel=rng.uniform(0, 0.5),
        )


def tiles(canvas: Canvas, rng: Rng) -> None:
    """Joints between tiles or bricks: the ground darkened or lightened along a lattice."""
    pitch = rng.uniform(0.08, 0.4) * canvas.width
    u, v = _plane(canvas, rng.uniform(-np.pi, np.pi), pitch)
    v = v * rng.uniform(0.6, 2.0)
    bonded = u + 0.5 * (torch.floor(v) % 2) if rng.random() < 0.5 else u
    edge = torch.minimum(_to_edge(bonded), _to_edge(v)) * pitch
    joint = (rng.uniform(0.6, 0.012 * canvas.width + 0.7) + 0.5 - edge).clamp(0, 1) * rng.uniform(
        0.2, 0.9
    )
    color = canvas.rgb.new_tensor(random_gray(rng))[:, None, None]
    canvas.rgb += joint * (color - canvas.rgb)


def folds(canvas: Canvas, rng: Rng) -> None:
    """Soft light and dark waves (cloth, corrugated card), or sharp dark creases between them
    (leather)."""
    u, v = _plane(canvas, rng.uniform(-np.pi, np.pi), rng.uniform(0.01, 0.25) * canvas.width)
    warp = torch.sin(0.31 * u + 0.23 * v + rng.uniform(0, 6)) * rng.uniform(0, 3)
    wave = 0.5 + 0.5 * torch.sin(2 * torch.pi * u + warp + 0.4 * torch.sin(1.7 * v))
    canvas.darken(
        wave ** rng.choice([rng.uniform(0.5, 6), rng.uniform(15, 60)]), rng.uniform(0.05, 0.6)
    )


def wood_grain(canvas: Canvas, rng: Rng) -> None:
    """Long thin veins of one hue, bent around a knot."""
    u, v = _plane(canvas, rng.uniform(-np.pi, np.pi), rng.uniform(0.015, 0.08) * canvas.width)
    knot = torch.exp(-((u - rng.uniform(-5, 5)) ** 2 + (0.2 * v) ** 2) / rng.uniform(2, 12))
    rings = (
        u + rng.uniform(0.2, 2) * torch.sin(0.05 * v + rng.uniform(0, 6)) + rng.uniform(0, 3) * knot
    )
    vein = 0.6 * torch.sin(2 * torch.pi * rings) + 0.4 * torch.sin(
        15.1 * rings + torch.sin(0.3 * v)
    )
    canvas.darken((0.5 + 0.5 * vein).clamp(0, 1) ** 2, rng.uniform(0.1, 0.45))


def bars_of_shadow(canvas: Canvas, rng: Rng) -> None:
    """Soft shadows of rods, pipes and frames outside the picture: straight, dark, without an
    object."""
    angle = rng.uniform(-np.pi, np.pi)
    for _ in range(rng.integers(1, 4)):
        u, _ = _plane(canvas, angle + rng.normal(0, 0.1), 1.0)
        half = rng.uniform(0.004, 0.04) * canvas.width
        distance = (u - rng.uniform(-0.4, 0.4) * canvas.width).abs()
        soft = rng.uniform(1.0, 1.5 * half + 1.5)
        canvas.darken(((half - distance) / soft + 0.5).clamp(0, 1), rng.uniform(0.15, 0.7))


def glare(canvas: Canvas, rng: Rng) -> None:
    """A lamp or a window mirrored by a shiny table: a bright tube or spot with soft ends."""
    at = rng.uniform((0, 0), (canvas.width, canvas.height))
    u, v = _plane(canvas, rng.uniform(-np.pi, np.pi), canvas.width, at)
    length, thick = rng.uniform(0.02, 0.35), rng.uniform(0.01, 0.06)
    spot = torch.exp(-((u / length) ** 4) - (v / thick) ** 2) * rng.uniform(0.3, 1.1)
    canvas.rgb += spot * (1 - canvas.rgb).clamp(min=0)


def _plane(
    canvas: Canvas, angle: float, unit: float, origin: np.ndarray | None = None
) -> tuple[Tensor, Tensor]:
    """Coordinates (H, W) of the picture along and across ``angle``, about its center, in ``unit``
    px."""
    x0, y0 = (canvas.width / 2, canvas.height / 2) if origin is None else origin
    x = (torch.arange(canvas.width, device=canvas.rgb.device)[None] - x0) / unit
    y = (torch.arange(canvas.height, device=canvas.rgb.device)[:, None] - y0) / unit
    (cos, sin), _ = axes(angle)
    return x * float(cos) + y * float(sin), y * float(cos) - x * float(sin)


def _to_edge(u: Tensor) -> Tensor:
    """Distance to the nearest whole number."""
    return (u - u.round()).abs()
