"""What a cable's end is put into: ferrules, lugs, plugs, housings, round connectors; and cable
ties."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.synthesis.canvas import Canvas
from models.synthesis.curves import axes
from models.synthesis.looks import random_color, random_gray

Rng = np.random.Generator


def terminal(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half_width: float) -> None:
    """Some connector that swallows the end of a cable at ``at`` (px); it lies on top and is not
    cable."""
    kinds: tuple[Callable[..., None], ...] = (_block, _block, _ferrule, _lug, _housing, _round_plug)
    kinds[rng.integers(len(kinds))](canvas, rng, at, heading, half_width)


def tie(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half_width: float) -> None:
    """A cable tie around a bundle: a thin strap across, its head to one side, the cut tail."""
    across = axes(heading)[1]
    color = random_gray(rng, 0.0, 0.2) if rng.random() < 0.7 else random_gray(rng, 0.8, 1.0)
    strap = max(rng.uniform(0.1, 0.25) * half_width, 0.8)
    canvas.box(at, (strap, 1.1 * half_width), heading, color, covers=True)
    side = at + across * half_width * rng.choice([-1.15, 1.15])
    canvas.box(side, (1.5 * strap, 1.5 * strap), heading, color, covers=True)
    tail = rng.uniform(1.0, 5.0) * strap
    canvas.box(side + axes(heading + 0.5)[1] * tail, (0.6 * strap, tail), heading + 0.5, color)


def _block(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half: float) -> None:
    """A plain body with ridges."""
    length, thick = half * rng.uniform(1.2, 7), half * rng.uniform(1.0, 3.5)
    along, across = axes(heading)
    middle = at + along * length * 0.6
    color = random_gray(rng) if rng.random() < 0.7 else random_color(rng)
    canvas.box(middle + across * 2, (length, thick), heading, (0, 0, 0), opacity=0.35)
    canvas.box(
        middle,
        (length, thick),
        heading,
        color,
        corner=0.3 * half,
        bevel=rng.uniform(-0.5, 0.5),
        covers=True,
    )
    for k in range(rng.integers(0, 4)):
        canvas.box(
            middle + along * length * (0.5 * k - 0.6),
            (0.08 * length, thick),
            heading,
            random_gray(rng),
        )


def _ferrule(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half: float) -> None:
    """A colored plastic collar, then a thin bright tube."""
    along = axes(heading)[0]
    collar, tube = half * rng.uniform(1.0, 2.5), half * rng.uniform(2.0, 5.0)
    canvas.box(
        at + along * (2 * collar + tube),
        (tube, 0.6 * half),
        heading,
        random_gray(rng, 0.6, 0.95),
        corner=0.2 * half,
        bevel=-0.6,
        covers=True,
    )
    canvas.box(
        at + along * collar,
        (collar, 1.3 * half),
        heading,
        random_color(rng),
        corner=0.3 * half,
        bevel=-0.4,
        covers=True,
    )


def _lug(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half: float) -> None:
    """A crimp barrel and a flat ring of metal with a hole."""
    along = axes(heading)[0]
    metal, barrel, ring = (
        random_gray(rng, 0.5, 0.95),
        half * rng.uniform(1.5, 3.0),
        half * rng.uniform(1.6, 2.6),
    )
    eye = at + along * (2 * barrel + ring)
    canvas.disc(eye, ring, metal, bevel=0.3, covers=True)
    canvas.disc(eye, 0.5 * ring, random_gray(rng, 0.0, 0.5))
    sleeve = random_color(rng) if rng.random() < 0.6 else metal
    canvas.box(
        at + along * barrel,
        (barrel, 1.25 * half),
        heading,
        sleeve,
        corner=0.3 * half,
        bevel=-0.5,
        covers=True,
    )


def _housing(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half: float) -> None:
    """A socket housing: a stepped body with windows in a row and a latch."""
    along, across = axes(heading)
    length, thick = half * rng.uniform(3, 6), half * rng.uniform(1.5, 5)
    middle = at + along * 0.8 * length
    color = random_gray(rng, 0.02, 0.3) if rng.random() < 0.5 else random_gray(rng, 0.75, 1.0)
    canvas.box(middle + 0.3 * half, (length, thick), heading, (0, 0, 0), opacity=0.35)
    canvas.box(middle, (length, thick), heading, color, corner=0.15 * half, bevel=0.2, covers=True)
    canvas.box(
        middle + along * 0.5 * length,
        (0.5 * length, 1.15 * thick),
        heading,
        color,
        bevel=-0.2,
        covers=True,
    )
    rows = max(int(thick / half), 1)
    canvas.lattice(
        middle - along * 0.3 * length,
        (1, rows),
        (length, 2 * thick / rows),
        heading,
        (0.25 * length, 0.35 * thick / rows),
        random_gray(rng, 0.0, 0.5),
    )
    canvas.box(
        middle + across * 0.5 * thick, (0.3 * length, 0.15 * thick), heading, color, bevel=0.5
    )


def _round_plug(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half: float) -> None:
    """A strain relief that widens in rings, a grip, and a metal shell."""
    along = axes(heading)[0]
    dark, place = random_gray(rng, 0.02, 0.35), at
    for k in range(4):
        canvas.box(
            place,
            (0.35 * half, (1.1 + 0.15 * k) * half),
            heading,
            dark,
            corner=0.2 * half,
            bevel=-0.4,
            covers=True,
        )
        place = place + along * 0.9 * half
    grip, thick = half * rng.uniform(2, 5), half * rng.uniform(1.7, 2.6)
    canvas.box(
        place + along * grip,
        (grip, thick),
        heading,
        dark,
        corner=0.3 * half,
        bevel=-0.5,
        covers=True,
    )
    shell = place + along * (2 * grip + half)
    canvas.box(
        shell, (half, 0.85 * thick), heading, random_gray(rng, 0.6, 0.95), bevel=-0.6, covers=True
    )
