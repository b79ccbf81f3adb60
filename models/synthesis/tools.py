"""Long things that are not cables: pens, rods, pipes, wrenches, screwdrivers, pliers. The hard
negatives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from models.synthesis.cables import paint_thing
from models.synthesis.canvas import Canvas
from models.synthesis.curves import FloatArray, axes
from models.synthesis.looks import Color, Look, random_color, random_gray, random_light
from models.synthesis.panels import screw

Rng = np.random.Generator


def rods(canvas: Canvas, rng: Rng) -> None:
    """Rods, pens, bent bars shaded like cylinders, screws and nuts."""
    for _ in range(rng.integers(1, 9)):
        at = rng.uniform((0, 0), (canvas.width, canvas.height))
        if rng.random() < 0.25:
            screw(canvas, rng, at, rng.uniform(0.008, 0.03) * canvas.width)
        else:
            (_pen if rng.random() < 0.25 else _bar)(canvas, rng, at)


def wrench(canvas: Canvas, rng: Rng) -> None:
    """A flat steel bar with a ring at one end and open jaws at the other."""
    w = canvas.width
    at, angle = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    along, across = axes(angle)
    half, length = rng.uniform(0.006, 0.018) * w, rng.uniform(0.1, 0.35) * w
    steel, ground = random_gray(rng, 0.4, 0.9), random_gray(rng, 0.02, 0.6)
    ends = at + along * length, at - along * length
    canvas.box(at + 0.5 * half, (length, half), angle, (0, 0, 0), opacity=0.4)
    canvas.box(at, (length, half), angle, steel, corner=0.5 * half, bevel=rng.uniform(-0.4, 0.4))
    canvas.box(at, (0.7 * length, 0.4 * half), angle, steel, bevel=-0.5)
    for end in ends:
        canvas.disc(end, 2.2 * half, steel, bevel=0.2)
    canvas.disc(ends[0], 1.2 * half, ground)
    canvas.box(
        ends[1] - along * 1.5 * half + across * 0.2 * half, (1.6 * half, half), angle + 0.25, ground
    )


def screwdriver(canvas: Canvas, rng: Rng) -> None:
    """A thin shaft in a thick, often two-colored handle."""
    w = canvas.width
    at, heading = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    shaft, handle = rng.uniform(0.1, 0.3) * w, rng.uniform(0.06, 0.18) * w
    thin, thick = rng.uniform(0.003, 0.008) * w, rng.uniform(0.012, 0.03) * w
    along = axes(heading)[0]
    _rod(canvas, rng, [at, at + along * shaft], thin, random_gray(rng, 0.4, 0.95))
    end = at + along * (shaft + handle)
    _rod(
        canvas,
        rng,
        [at + along * shaft, end],
        thick,
        random_color(rng),
        pattern_period=rng.uniform(0.5, 3) * thick,
    )
    canvas.disc(end, thick, random_gray(rng), bevel=-0.3)


def pliers(canvas: Canvas, rng: Rng) -> None:
    """Two bowed handles in one color that meet in a joint, and two steel jaws."""
    w = canvas.width
    joint, heading = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    along, across = axes(heading)
    length, half = rng.uniform(0.1, 0.28) * w, rng.uniform(0.008, 0.02) * w
    color, spread = random_color(rng), rng.uniform(0.15, 0.4) * length
    steel = random_gray(rng, 0.3, 0.8)
    for side in (-1, 1):
        bow = joint + along * 0.45 * length + across * side * spread
        _rod(
            canvas,
            rng,
            [joint, bow, joint + along * length + across * side * spread * 0.7],
            half,
            color,
        )
        tip = joint - along * 0.45 * length
        wide = joint + across * side * 1.6 * half
        corners = [joint, wide, tip + across * side * 0.3 * half, tip]
        canvas.polygon(corners if side < 0 else corners[::-1], steel, bevel=0.3)
    screw(canvas, rng, joint, 1.3 * half)


def _bar(canvas: Canvas, rng: Rng, at: np.ndarray) -> None:
    """A rod, sometimes with a sharp bend (an Allen key), a handle or a head."""
    w = canvas.width
    length, heading = rng.uniform(0.06, 0.6) * w, rng.uniform(-np.pi, np.pi)
    points = [at, at + length * axes(heading)[0]]
    if rng.random() < 0.4:
        turn = heading + rng.choice([-1, 1]) * 1.5
        points.append(points[-1] + rng.uniform(0.15, 0.5) * length * axes(turn)[0])
    color = random_gray(rng) if rng.random() < 0.6 else random_color(rng)
    head = rng.uniform(1.3, 2.5) if rng.random() < 0.5 else 1.0
    _rod(canvas, rng, points, rng.uniform(0.003, 0.016) * w, color, head=head)


def _pen(canvas: Canvas, rng: Rng, at: np.ndarray) -> None:
    """A barrel with a cap of another color, a clip and a pointed tip."""
    w = canvas.width
    heading, length, half = (
        rng.uniform(-np.pi, np.pi),
        rng.uniform(0.1, 0.3) * w,
        rng.uniform(0.005, 0.014) * w,
    )
    along, across = axes(heading)
    barrel, cap = random_color(rng), random_color(rng)
    _rod(canvas, rng, [at, at + along * length], half, barrel)
    _rod(canvas, rng, [at, at + along * length * rng.uniform(0.15, 0.4)], 1.15 * half, cap)
    tip = at + along * length
    canvas.polygon([tip - across * half, tip + along * 3 * half, tip + across * half], barrel)
    canvas.box(
        at + along * 0.15 * length,
        (0.12 * length, 0.25 * half),
        heading,
        random_gray(rng, 0.5, 1.0),
    )


def _rod(
    canvas: Canvas,
    rng: Rng,
    points: list[np.ndarray],
    half: float,
    color: Color,
    *,
    head: float = 1.0,
    pattern_period: float = 0.0,
) -> None:
    """A cylinder along ``points``; its first part is ``head`` times as thick; grooves every
    ``pattern_period``."""
    curve = _polyline(points)
    look = Look(
        color,
        color,
        "corrugated" if pattern_period else "plain",
        max(pattern_period, 3.0),
        gloss=rng.uniform(0, 0.9),
        shininess=rng.uniform(5, 60),
        grain=0.0,
        opacity=1.0,
    )
    widths = np.full(len(curve), half, np.float32)
    widths[: int(len(widths) * rng.uniform(0.1, 0.6))] *= head
    paint_thing(canvas, curve, widths, look, random_light(rng), rng)


def _polyline(points: list[np.ndarray]) -> FloatArray:
    """Dense samples (m, 3) along straight legs, at height 0."""
    legs = [np.linspace(a, b, max(int(np.hypot(*(b - a)) / 0.7), 2)) for a, b in pairwise(points)]
    flat = np.concatenate(legs)
    return np.concatenate([flat, np.zeros((len(flat), 1))], 1).astype(np.float32)
