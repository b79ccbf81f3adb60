"""Thrown paint and murals: flat, uneven threads, strokes and drops without relief or shadow."""

from __future__ import annotations

import numpy as np
import torch

from models.synthesis.cables import paint_thing
from models.synthesis.canvas import Canvas
from models.synthesis.curves import CurveParams, interpolate, propagate
from models.synthesis.looks import Color, Light, flat_look, random_color

Rng = np.random.Generator
_FLAT = Light((0.0, 0.0, 1.0), ambient=1.0, shadow=0.0, softness=0, color=(1.0, 1.0, 1.0))


def splatter(canvas: Canvas, rng: Rng) -> None:
    """Some threads and up to a thousand drops, most of them tiny."""
    colors = [random_color(rng) for _ in range(rng.integers(2, 7))]
    for _ in range(rng.integers(2, 16)):
        start = rng.uniform((0, 0), (canvas.width, canvas.height))
        long = rng.random() < 0.3
        thread(
            canvas,
            rng,
            start,
            colors[rng.integers(len(colors))],
            rng.uniform(0.001, 0.005),
            long=long,
        )
    _drops(canvas, rng, colors, int(np.exp(rng.uniform(np.log(20), np.log(1000)))), 0.003)


def mural(canvas: Canvas, rng: Rng) -> None:
    """A whole picture of action painting or graffiti: hundreds of threads, thousands of drops.
    Slow, so it is painted once into the texture pool and not on every scene."""
    colors: list[Color] = [(v, v, v) for v in (0.03, 0.1, 0.75, 0.95)]
    colors += [random_color(rng) for _ in range(rng.integers(1, 6))]
    graffiti = rng.random() < 0.25
    for _ in range(rng.integers(30, 90) if graffiti else rng.integers(80, 260)):
        start = rng.uniform((0, 0), (canvas.width, canvas.height))
        thick = rng.uniform(0.01, 0.05) if graffiti else rng.uniform(0.001, 0.006)
        thread(
            canvas, rng, start, colors[rng.integers(len(colors))], thick, long=rng.random() < 0.4
        )
        if rng.random() < 0.3:
            _drops(canvas, rng, colors, 60, 0.01 if graffiti else 0.002)


def mosaic(canvas: Canvas, rng: Rng) -> None:
    """Bold curved strokes of paint, wide and flat, as a mural: cable-like in shape but not in
    relief."""
    for _ in range(rng.integers(4, 20)):
        at = rng.uniform((0, 0), (canvas.width, canvas.height))
        thread(canvas, rng, at, random_color(rng), rng.uniform(0.01, 0.05))


def thread(
    canvas: Canvas, rng: Rng, at: np.ndarray, color: Color, thickness: float, *, long: bool = False
) -> None:
    """A stroke from ``at``, ``thickness`` in shares of W; a ``long`` one runs far and turns
    little."""
    step = (
        rng.uniform(0.04, 0.12) * canvas.width if long else rng.uniform(0.015, 0.06) * canvas.width
    )
    turn, wander = (0.15, 0.3) if long else (rng.uniform(0.1, 0.8), rng.uniform(0.2, 0.9))
    params = CurveParams((0.3 * step, 1.6 * step), turn, wander, int(rng.integers(4, 9)))
    curve = interpolate(
        propagate(rng, at.astype(np.float32), rng.uniform(-np.pi, np.pi), params), 0.7
    )
    swell = np.interp(
        np.linspace(0, 1, len(curve)), np.linspace(0, 1, 7), rng.uniform(0.15, 1.0, 7)
    )
    half = (0.4 + swell * thickness * canvas.width).astype(np.float32)
    paint_thing(canvas, curve, half, flat_look(color), _FLAT, rng)


def _drops(canvas: Canvas, rng: Rng, colors: list[Color], count: int, typical: float) -> None:
    """``typical`` radius in shares of W; radii are distributed exponentially, so that most are
    dots."""
    device = canvas.rgb.device
    centers = rng.uniform((0, 0), (canvas.width, canvas.height), (count, 2)).astype(np.float32)
    radii = (
        0.4
        + rng.exponential(typical, count).clip(max=5 * typical).astype(np.float32) * canvas.width
    )
    picked = torch.tensor(colors, device=device)[
        torch.as_tensor(rng.integers(len(colors), size=count))
    ]
    small = radii < 2.5  # few are large: apart, so that the many small ones need only small windows
    for part in (~small, small):
        if part.any():
            at, radius = (torch.as_tensor(a[part], device=device) for a in (centers, radii))
            canvas.drops(at, radius, picked[torch.as_tensor(part, device=device)])
