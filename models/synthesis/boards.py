"""Printed circuit boards: traces, vias, chips with rows of pins, small parts, sockets."""

from __future__ import annotations

import colorsys

import numpy as np
import torch

from models.synthesis.canvas import Canvas
from models.synthesis.curves import axes
from models.synthesis.looks import random_gray

Rng = np.random.Generator


def board(canvas: Canvas, rng: Rng) -> None:
    """A board with a few dozen parts, about half the picture's width."""
    center = rng.uniform((0, 0), (canvas.width, canvas.height))
    half = rng.uniform(0.12, 0.35, 2) * canvas.width
    angle = float(rng.normal(0, 0.6))
    hue = rng.choice([0.38, 0.36, 0.6, 0.0, 0.12])
    color = np.array(colorsys.hsv_to_rgb(hue, rng.uniform(0.5, 1.0), rng.uniform(0.15, 0.5)))
    canvas.box(center + 0.01 * canvas.width, half, angle, (0, 0, 0), opacity=0.4)
    canvas.box(center, half, angle, color, corner=0.01 * canvas.width)
    _traces(canvas, rng, center, half, angle, np.clip(color * rng.uniform(1.2, 1.7), 0, 1))
    _vias(canvas, rng, center, half, angle)
    for _ in range(rng.integers(2, 7)):
        _chip(canvas, rng, _on(rng, center, half, angle), angle + rng.choice([0.0, np.pi / 2]))
    for _ in range(rng.integers(3, 12)):
        _part(canvas, rng, _on(rng, center, half, angle), angle + rng.choice([0.0, np.pi / 2]))


def _on(rng: Rng, center: np.ndarray, half: np.ndarray, angle: float) -> np.ndarray:
    u, v = rng.uniform(-0.85, 0.85, 2) * half
    along, across = axes(angle)
    return np.asarray(center + u * along + v * across)


def _traces(
    canvas: Canvas, rng: Rng, center: np.ndarray, half: np.ndarray, angle: float, color: np.ndarray
) -> None:
    """Buses of thin parallel lines."""
    for _ in range(rng.integers(1, 5)):
        pitch = rng.uniform(0.006, 0.015) * canvas.width
        counts, turn = int(rng.integers(2, 8)), angle + rng.choice([0.0, np.pi / 4, np.pi / 2])
        length = rng.uniform(0.2, 0.8) * float(half.min())
        canvas.lattice(
            _on(rng, center, half * 0.5, angle),
            (1, counts),
            (2 * length, pitch),
            turn,
            (length, 0.25 * pitch),
            color,
        )


def _vias(canvas: Canvas, rng: Rng, center: np.ndarray, half: np.ndarray, angle: float) -> None:
    n = int(rng.integers(10, 80))
    at = np.stack([_on(rng, center, half, angle) for _ in range(n)]).astype(np.float32)
    radii = torch.as_tensor(rng.uniform(0.5, 0.006 * canvas.width + 0.6, n).astype(np.float32))
    gold = torch.tensor([[0.8, 0.75, 0.5]]).expand(n, 3)
    canvas.drops(*(t.to(canvas.rgb.device) for t in (torch.as_tensor(at), radii, gold)))


def _chip(canvas: Canvas, rng: Rng, at: np.ndarray, angle: float) -> None:
    """A black body between two rows of bright pins."""
    pitch = rng.uniform(0.008, 0.016) * canvas.width
    pins, wide = int(rng.integers(3, 12)), rng.uniform(2.0, 5.0) * pitch
    canvas.lattice(
        at,
        (pins, 1),
        (pitch, 4 * wide),
        angle,
        (0.25 * pitch, wide + pitch),
        random_gray(rng, 0.6, 0.95),
    )
    canvas.box(at, (pins * pitch / 2, wide), angle, random_gray(rng, 0.02, 0.2), bevel=-0.2)


def _part(canvas: Canvas, rng: Rng, at: np.ndarray, angle: float) -> None:
    """A resistor or a capacitor with two metal ends, or a round can."""
    size = rng.uniform(0.006, 0.02) * canvas.width
    if rng.random() < 0.25:
        canvas.disc(at, 1.5 * size, random_gray(rng), bevel=-0.4)
        return
    canvas.box(at, (1.6 * size, 0.6 * size), angle, random_gray(rng, 0.6, 0.95))
    canvas.box(at, (size, 0.6 * size), angle, random_gray(rng, 0.02, 0.7), bevel=-0.3)
