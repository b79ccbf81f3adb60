"""Things that are not cables: panels, terminals, rails, keys, holes, labels, tools, splatter, seams.

Each painter takes a canvas and a generator and paints one kind of clutter; sizes are in shares of the
picture's width W, so that the same scene can be rendered at any size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from models.synthesis.cables import Light, Look, paint_cable, random_color, random_light
from models.synthesis.canvas import Canvas
from models.synthesis.curves import CurveParams, interpolate, propagate

Rng = np.random.Generator
Painter = Callable[[Canvas, Rng], None]
Style = Literal["mixed", "plain", "busy", "industrial"]


def paint_clutter(canvas: Canvas, rng: Rng, style: Style) -> None:
    """What stands in the background: nothing, thrown paint, machine parts, or up to four of anything."""
    match style:
        case "plain":
            return
        case "busy":
            mural(canvas, rng)
        case "industrial":
            for painter in (rails, panel, panel, grid, label, tools):
                painter(canvas, rng)
        case "mixed":
            for _ in range(rng.choice([0, 1, 2, 3, 4], p=[0.12, 0.26, 0.28, 0.2, 0.14])):
                PAINTERS[rng.integers(len(PAINTERS))](canvas, rng)


def seams(canvas: Canvas, rng: Rng) -> None:
    """Long straight lines and edges: tile joints, table edges, creases."""
    w = canvas.width
    angle, color = rng.uniform(-np.pi, np.pi), _gray(rng)
    for _ in range(rng.integers(1, 5)):
        at = rng.uniform((0, 0), (w, canvas.height))
        turn = angle + rng.choice([0.0, np.pi / 2]) + rng.normal(0, 0.05)
        thick = 0.5 + rng.uniform(0, 0.005) * w if rng.random() < 0.7 else rng.uniform(0.006, 0.03) * w
        canvas.box(at, (2 * w, thick), turn, color, opacity=rng.uniform(0.2, 1.0), bevel=rng.uniform(0, 0.5))


def panel(canvas: Canvas, rng: Rng) -> None:
    """A box with a shadow, a bevel and a few smaller parts on it: a device, a block, a laptop edge."""
    w = canvas.width
    center = rng.uniform((0, 0), (w, canvas.height))
    half = rng.uniform((0.06 * w, 0.05 * w), (0.4 * w, 0.3 * w))
    angle = rng.normal(0, 0.3)
    canvas.box(center + rng.normal(0, 0.012 * w, 2), half * 1.02, angle, (0, 0, 0), opacity=rng.uniform(0, 0.5))
    canvas.box(center, half, angle, random_color(rng) if rng.random() < 0.4 else _gray(rng),
               corner=rng.uniform(0, 0.02) * w, bevel=rng.uniform(-0.3, 0.3))  # fmt: skip
    for _ in range(rng.integers(0, 9)):
        part = center + rng.uniform(-0.85, 0.85, 2) * half
        if rng.random() < 0.4:
            canvas.disc(part, rng.uniform(0.005, 0.03) * w, _gray(rng), bevel=rng.uniform(-0.6, 0.6))
        else:
            canvas.box(part, rng.uniform(0.005 * w, 0.08 * w, 2), angle, _gray(rng), bevel=rng.uniform(-0.4, 0.4))


def grid(canvas: Canvas, rng: Rng) -> None:
    """Keys, terminals with screws, or a perforated sheet: one part repeated over a lattice."""
    w = canvas.width
    pitch = rng.uniform(0.02, 0.09) * w
    angle = rng.normal(0, 0.4)
    axis = np.array([np.cos(angle), np.sin(angle)])
    cross = np.array([-axis[1], axis[0]]) * rng.uniform(0.7, 1.6)
    nx, ny = rng.integers(2, 13), rng.integers(1, 8)
    origin = rng.uniform((0, 0), (w, canvas.height)) - pitch * (axis * nx + cross * ny) / 2
    if rng.random() < 0.7:
        middle = origin + pitch * (axis * (nx - 1) + cross * (ny - 1)) / 2
        canvas.box(middle, pitch * np.array([nx, ny * 1.2]) / 1.9, angle, _gray(rng), bevel=rng.uniform(-0.2, 0.2))
    color, hole = _gray(rng) if rng.random() < 0.7 else random_color(rng), _gray(rng)
    round_part, share, screw = rng.random() < 0.4, rng.uniform(0.25, 0.47), rng.random() < 0.5
    for i in range(nx):
        for j in range(ny):
            at = origin + pitch * (axis * i + cross * j)
            if round_part:
                canvas.disc(at, share * pitch, color, bevel=-0.3)
            else:
                canvas.box(at, (share * pitch, share * pitch), angle, color, corner=0.15 * pitch, bevel=0.2)
            if screw:
                canvas.disc(at, 0.5 * share * pitch, hole, bevel=0.5)


def rails(canvas: Canvas, rng: Rng) -> None:
    """Parallel bars and slots with a metallic gradient, as aluminium profiles."""
    w = canvas.width
    angle, at = rng.uniform(-np.pi, np.pi), rng.uniform((0, 0), (w, canvas.height))
    across = np.array([-np.sin(angle), np.cos(angle)])
    for _ in range(rng.integers(2, 9)):
        thick = rng.uniform(0.004, 0.04) * w
        canvas.box(at, (rng.uniform(0.3, 2) * w, thick), angle, _gray(rng), bevel=rng.uniform(-0.7, 0.7))
        at = at + across * thick * rng.uniform(1.0, 3.0)


def label(canvas: Canvas, rng: Rng) -> None:
    """A sticker with rows of text-like marks."""
    w = canvas.width
    center, angle = rng.uniform((0, 0), (w, canvas.height)), rng.normal(0, 0.5)
    half = rng.uniform((0.04 * w, 0.02 * w), (0.16 * w, 0.08 * w))
    paper, ink = (_gray(rng, 0.75, 1.0), _gray(rng, 0.0, 0.3))
    if rng.random() < 0.3:
        paper, ink = ink, paper
    canvas.box(center, half, angle, paper, corner=0.004 * w)
    axis, cross = _axes(angle)
    rows, height = rng.integers(1, 5), half[1] / 6
    for row in range(rows):
        x = -0.85 * half[0]
        while x < 0.8 * half[0]:
            length = rng.uniform(0.3, 1.6) * height
            at = center + axis * (x + length) + cross * (row + 0.5 - rows / 2) * 2 * half[1] / (rows + 0.6)
            canvas.box(at, (length, height * rng.uniform(0.3, 1)), angle, ink)
            x += 2 * length + rng.uniform(0.3, 1.2) * height


def tools(canvas: Canvas, rng: Rng) -> None:
    """Rods, pens, keys and bent bars shaded like cylinders, screws and nuts: the hard negatives."""
    w = canvas.width
    for _ in range(rng.integers(1, 9)):
        at = rng.uniform((0, 0), (w, canvas.height))
        if rng.random() < 0.25:
            radius = rng.uniform(0.008, 0.03) * w
            canvas.disc(at + 0.3 * radius, radius, (0, 0, 0), opacity=0.4)
            canvas.disc(at, radius, _gray(rng), bevel=rng.uniform(-0.7, 0.7))
            canvas.disc(at, 0.5 * radius, _gray(rng))
            continue
        _rod(canvas, rng, at)


def splatter(canvas: Canvas, rng: Rng) -> None:
    """Thrown paint: drops and flat, uneven, sharply turning threads of paint without relief or shadow."""
    w = canvas.width
    colors = [random_color(rng) for _ in range(rng.integers(2, 6))]
    flat = replace(random_light(rng), ambient=1.0, shadow=0.0)
    for _ in range(rng.integers(10, 60)):
        color = colors[rng.integers(len(colors))]
        at = rng.uniform((0, 0), (w, canvas.height))
        if rng.random() < 0.65:
            canvas.disc(at, rng.exponential(0.006) * w + 0.5, color)
        else:
            _thread(canvas, rng, at, color, flat)


def mural(canvas: Canvas, rng: Rng) -> None:
    """A whole picture of action painting or graffiti: hundreds of drops and threads. Slow (a second), so
    it is painted once into the texture pool and not on every scene."""
    w = canvas.width
    gray = [(v, v, v) for v in (0.03, 0.1, 0.75, 0.95)]
    colors = gray + [random_color(rng) for _ in range(rng.integers(1, 6))]
    flat = replace(random_light(rng), ambient=1.0, shadow=0.0)
    graffiti = rng.random() < 0.25
    for _ in range(rng.integers(30, 90) if graffiti else rng.integers(150, 500)):
        color = colors[rng.integers(len(colors))]
        at = rng.uniform((0, 0), (w, canvas.height))
        if rng.random() < 0.5:
            canvas.disc(at, rng.exponential(0.02 if graffiti else 0.005) * w + 0.5, color)
        else:
            _thread(
                canvas,
                rng,
                at,
                color,
                flat,
                rng.uniform(0.01, 0.05) if graffiti else rng.uniform(0.001, 0.006),
            )


def folds(canvas: Canvas, rng: Rng) -> None:
    """Soft parallel light and dark waves: cloth, leather, corrugated card."""
    import torch

    angle, period = rng.uniform(-np.pi, np.pi), rng.uniform(0.01, 0.25) * canvas.width
    x = torch.arange(canvas.width, device=canvas.rgb.device)[None] / period
    y = torch.arange(canvas.height, device=canvas.rgb.device)[:, None] / period
    warp = torch.sin((x * 0.31 + y * 0.23) + rng.uniform(0, 6)) * rng.uniform(0, 3)
    wave = torch.sin(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) + warp)
    canvas.darken((0.5 + 0.5 * wave) ** rng.uniform(0.5, 6), rng.uniform(0.05, 0.6))


def mosaic(canvas: Canvas, rng: Rng) -> None:
    """Bold curved strokes of paint, wide and flat, as a mural: cable-like in shape but not in relief."""
    flat = replace(random_light(rng), ambient=1.0, shadow=0.0)
    for _ in range(rng.integers(4, 20)):
        at = rng.uniform((0, 0), (canvas.width, canvas.height))
        _thread(canvas, rng, at, random_color(rng), flat, thickness=rng.uniform(0.01, 0.05))


# What is taken for a cable most often comes most often: joints, rods, thrown paint.
PAINTERS: tuple[Painter, ...] = (
    *(seams, seams, seams),
    *(panel, panel),
    grid,
    *(rails, rails),
    label,
    *(tools, tools, tools, tools),
    *(splatter, splatter),
    folds,
    mosaic,
)


def terminal(canvas: Canvas, rng: Rng, at: np.ndarray, heading: float, half_width: float) -> None:
    """A connector, ferrule or clamp that swallows the end of a cable at ``at``; it lies on top."""
    length = half_width * rng.uniform(1.2, 7)
    thick = half_width * rng.uniform(1.0, 3.5)
    axis, cross = _axes(heading)
    middle = at + axis * length * 0.6
    color = _gray(rng) if rng.random() < 0.7 else random_color(rng)
    canvas.box(middle + cross * 2, (length, thick), heading, (0, 0, 0), opacity=0.35)
    canvas.box(
        middle,
        (length, thick),
        heading,
        color,
        corner=0.3 * half_width,
        bevel=rng.uniform(-0.5, 0.5),
        covers=True,
    )
    for k in range(rng.integers(0, 4)):
        canvas.box(middle + axis * length * (0.5 * k - 0.6), (0.08 * length, thick), heading, _gray(rng))


def occluder(canvas: Canvas, rng: Rng) -> None:
    """Something that lies over the cables: a strap, a label, a part."""
    w = canvas.width
    at = rng.uniform((0, 0), (w, canvas.height))
    half = rng.uniform((0.01 * w, 0.01 * w), (0.12 * w, 0.05 * w))
    canvas.box(at + 0.01 * w, half, 0.0, (0, 0, 0), opacity=0.25)
    canvas.box(at, half, rng.uniform(-np.pi, np.pi), _gray(rng), bevel=rng.uniform(-0.4, 0.4), covers=True)


def _rod(canvas: Canvas, rng: Rng, at: np.ndarray) -> None:
    w = canvas.width
    length = rng.uniform(0.06, 0.4) * w
    half = rng.uniform(0.003, 0.014) * w
    heading = rng.uniform(-np.pi, np.pi)
    points = [at, at + length * _axes(heading)[0]]
    if rng.random() < 0.4:
        points.append(points[-1] + rng.uniform(0.15, 0.5) * length * _axes(heading + rng.choice([-1, 1]) * 1.5)[0])
    flat = np.concatenate([np.linspace(a, b, max(int(np.hypot(*(b - a)) / 0.7), 2))
                           for a, b in pairwise(points)])  # fmt: skip
    curve = np.concatenate([flat, np.zeros((len(flat), 1))], 1).astype(np.float32)
    color = tuple(_gray(rng)) if rng.random() < 0.6 else random_color(rng)
    look = Look(color, _gray(rng), "plain", 40.0, rng.uniform(0, 0.9), rng.uniform(5, 40), 0.0, 1.0)  # type: ignore[arg-type]
    widths = np.full(len(curve), half, np.float32)
    if rng.random() < 0.5:  # a handle or a head
        widths[: int(len(widths) * rng.uniform(0.1, 0.6))] *= rng.uniform(1.3, 2.5)
    paint_cable(canvas, curve, widths, look, random_light(rng), 0, rng)


def _thread(
    canvas: Canvas, rng: Rng, at: np.ndarray, color: tuple[float, float, float], flat: Light, thickness: float = 0.004
) -> None:  # fmt: skip
    w = canvas.width
    step = rng.uniform(0.015, 0.06) * w
    params = CurveParams(
        (0.3 * step, 1.6 * step), rng.uniform(0.1, 0.8), rng.uniform(0.2, 0.9), int(rng.integers(4, 9))
    )
    curve = interpolate(propagate(rng, at.astype(np.float32), rng.uniform(-np.pi, np.pi), params), 0.7)
    swell = np.interp(np.linspace(0, 1, len(curve)), np.linspace(0, 1, 7), rng.uniform(0.15, 1.0, 7))
    look = Look(color, color, "plain", 10.0, 0.0, 4.0, 0.0, 1.0)
    paint_cable(canvas, curve, (0.4 + swell * thickness * w).astype(np.float32), look, flat, 0, rng)


def _axes(angle: float) -> tuple[np.ndarray, np.ndarray]:
    axis = np.array([np.cos(angle), np.sin(angle)])
    return axis, np.array([-axis[1], axis[0]])


def _gray(rng: Rng, low: float = 0.02, high: float = 1.0) -> np.ndarray:
    return np.clip(rng.uniform(low, high) + rng.normal(0, 0.03, 3), 0, 1)
