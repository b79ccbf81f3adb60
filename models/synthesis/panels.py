"""Electric panels and machine parts: boxes, terminals, rails, ducts, perforated sheets, keys,
labels."""

from __future__ import annotations

import numpy as np

from models.synthesis.canvas import Canvas
from models.synthesis.curves import axes
from models.synthesis.looks import Color, random_color, random_gray

Rng = np.random.Generator


def panel(canvas: Canvas, rng: Rng) -> None:
    """A box with a shadow, a bevel and a few smaller parts on it: a device, a block, a laptop
    edge."""
    w = canvas.width
    center = rng.uniform((0, 0), (w, canvas.height))
    half = rng.uniform((0.06 * w, 0.05 * w), (0.4 * w, 0.3 * w))
    angle = rng.normal(0, 0.3)
    canvas.box(
        center + rng.normal(0, 0.012 * w, 2),
        half * 1.02,
        angle,
        (0, 0, 0),
        opacity=rng.uniform(0, 0.5),
    )
    canvas.box(
        center,
        half,
        angle,
        random_color(rng) if rng.random() < 0.4 else random_gray(rng),
        corner=rng.uniform(0, 0.02) * w,
        bevel=rng.uniform(-0.3, 0.3),
    )
    for _ in range(rng.integers(0, 9)):
        part = center + rng.uniform(-0.85, 0.85, 2) * half
        if rng.random() < 0.4:
            screw(canvas, rng, part, rng.uniform(0.005, 0.03) * w)
        else:
            canvas.box(
                part,
                rng.uniform(0.005 * w, 0.08 * w, 2),
                angle,
                random_gray(rng),
                bevel=rng.uniform(-0.4, 0.4),
            )


def grid(canvas: Canvas, rng: Rng) -> None:
    """One part repeated over a plate: buttons, vents, sockets, each with a smaller part in its
    middle."""
    w = canvas.width
    pitch = rng.uniform(0.02, 0.09) * w
    pitches = pitch, pitch * rng.uniform(0.7, 1.6)
    counts = int(rng.integers(2, 13)), int(rng.integers(1, 8))
    center, angle = rng.uniform((0, 0), (w, canvas.height)), rng.normal(0, 0.4)
    plate = np.array(counts) * pitches / 1.9
    if rng.random() < 0.7:
        canvas.box(center, plate, angle, random_gray(rng), bevel=rng.uniform(-0.2, 0.2))
    half = rng.uniform(0.25, 0.47) * min(pitches)
    color = random_gray(rng) if rng.random() < 0.7 else random_color(rng)
    corner = half if rng.random() < 0.4 else 0.3 * half
    canvas.lattice(center, counts, pitches, angle, (half, half), color, corner=corner, bevel=-0.25)
    if rng.random() < 0.5:
        inner = 0.5 * half
        canvas.lattice(
            center,
            counts,
            pitches,
            angle,
            (inner, inner),
            random_gray(rng),
            corner=inner,
            bevel=0.5,
        )


def perforated(canvas: Canvas, rng: Rng) -> None:
    """A metal sheet full of round or long holes."""
    w = canvas.width
    pitch = rng.uniform(0.012, 0.05) * w
    long = rng.uniform(1.0, 3.0) if rng.random() < 0.5 else 1.0
    half = rng.uniform(0.2, 0.4) * pitch
    center, angle = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    counts = int(rng.integers(8, 50)), int(rng.integers(5, 30))
    sheet = np.array(counts) * (pitch * long, pitch) / 2
    canvas.box(center, sheet, angle, random_gray(rng, 0.4, 0.95), bevel=rng.uniform(-0.2, 0.2))
    canvas.lattice(
        center,
        counts,
        (pitch * long, pitch),
        angle,
        (half * (1 + 1.6 * (long - 1)), half),
        random_gray(rng, 0.0, 0.35),
        corner=half,
        bevel=0.3,
    )


def keyboard(canvas: Canvas, rng: Rng) -> None:
    """Rows of keys with a mark on each."""
    w = canvas.width
    pitch = rng.uniform(0.03, 0.09) * w
    counts = int(rng.integers(6, 16)), int(rng.integers(3, 7))
    center, angle = rng.uniform((0, 0), (w, canvas.height)), rng.normal(0, 0.5)
    dark = rng.random() < 0.7
    key, mark = random_gray(rng, 0.03, 0.25), random_gray(rng, 0.6, 1.0)
    if not dark:
        key, mark = mark, key
    canvas.box(
        center,
        np.array(counts) * pitch * 0.53,
        angle,
        random_gray(rng, 0.02, 0.6),
        corner=0.2 * pitch,
    )
    canvas.lattice(
        center,
        counts,
        (pitch, pitch),
        angle,
        (0.43 * pitch, 0.43 * pitch),
        key,
        corner=0.1 * pitch,
        bevel=-0.3,
    )
    shift = axes(angle)[0] * pitch * 0.15
    canvas.lattice(
        center - shift, counts, (pitch, pitch), angle, (0.05 * pitch, 0.13 * pitch), mark
    )


def rails(canvas: Canvas, rng: Rng) -> None:
    """Parallel bars and slots with a metallic gradient, as aluminum profiles."""
    w = canvas.width
    angle, at = rng.uniform(-np.pi, np.pi), rng.uniform((0, 0), (w, canvas.height))
    across = axes(angle)[1]
    for _ in range(rng.integers(2, 9)):
        thick = rng.uniform(0.004, 0.04) * w
        canvas.box(
            at,
            (rng.uniform(0.3, 2) * w, thick),
            angle,
            random_gray(rng),
            bevel=rng.uniform(-0.7, 0.7),
        )
        at = at + across * thick * rng.uniform(1.0, 3.0)


def din_rail(canvas: Canvas, rng: Rng) -> None:
    """A top-hat rail: two bright flanges, a darker web with long holes."""
    w = canvas.width
    angle, at = _square(rng), rng.uniform((0, 0), (w, canvas.height))
    half, tone = rng.uniform(0.02, 0.06) * w, rng.uniform(0.45, 0.95)
    canvas.box(at + 0.2 * half, (2 * w, half), angle, (0, 0, 0), opacity=0.35)
    canvas.box(at, (2 * w, half), angle, (tone, tone, tone), bevel=0.1)
    canvas.box(at, (2 * w, 0.65 * half), angle, (0.75 * tone,) * 3, bevel=-0.3)
    canvas.lattice(
        at,
        (61, 1),
        (1.6 * half, 2 * half),
        angle,
        (0.5 * half, 0.2 * half),
        random_gray(rng, 0, 0.3),
        corner=0.2 * half,
    )


def duct(canvas: Canvas, rng: Rng) -> None:
    """A slotted cable duct: comb-like fingers along both edges of a lid."""
    w = canvas.width
    angle, at = _square(rng), rng.uniform((0, 0), (w, canvas.height))
    half, tone = rng.uniform(0.03, 0.1) * w, random_gray(rng, 0.3, 0.95)
    pitch = rng.uniform(0.2, 0.6) * half
    canvas.box(at, (2 * w, half * 1.5), angle, random_gray(rng, 0.0, 0.3))
    canvas.lattice(
        at,
        (int(4 * w / pitch) | 1, 1),
        (pitch, 3 * half),
        angle,
        (0.32 * pitch, 1.45 * half),
        tone,
        corner=0.1 * pitch,
    )
    canvas.box(at, (2 * w, 0.8 * half), angle, tone, bevel=rng.uniform(-0.2, 0.2))


def terminal_blocks(canvas: Canvas, rng: Rng) -> None:
    """A row of terminals: slices with a screw above, a wire hole below, and a strip of numbers."""
    w = canvas.width
    pitch, count = rng.uniform(0.03, 0.1) * w, int(rng.integers(2, 10))
    terminal_row(canvas, rng, rng.uniform((0, 0), (w, canvas.height)), _square(rng), pitch, count)


def terminal_row(
    canvas: Canvas, rng: Rng, center: np.ndarray, angle: float, pitch: float, count: int
) -> np.ndarray:
    """Paints it along ``angle`` and returns the middles of its wire holes (count, 2)."""
    along, across = axes(angle)
    deep = pitch * rng.uniform(1.0, 2.5)
    body = random_gray(rng, 0.1, 0.9) if rng.random() < 0.7 else random_color(rng)
    gap, pitches = random_gray(rng, 0.0, 0.3), (pitch, 2 * deep)
    canvas.box(center + 0.15 * pitch, (count * pitch / 2, deep), angle, (0, 0, 0), opacity=0.4)
    canvas.box(center, (count * pitch / 2, deep), angle, gap)
    canvas.lattice(
        center,
        (count, 1),
        pitches,
        angle,
        (0.46 * pitch, 0.98 * deep),
        body,
        corner=0.05 * pitch,
        bevel=0.15,
    )
    radius = rng.uniform(0.2, 0.38) * pitch
    holes, screws = center - across * deep * 0.6, center + across * deep * rng.uniform(0.0, 0.5)
    canvas.lattice(
        holes,
        (count, 1),
        (pitch, 3 * radius),
        angle,
        (radius, radius),
        gap,
        corner=radius if rng.random() < 0.6 else 0.1 * radius,
        bevel=0.4,
    )
    canvas.lattice(
        screws,
        (count, 1),
        (pitch, 3 * radius),
        angle,
        (radius, radius),
        random_gray(rng, 0.4, 0.9),
        corner=radius,
        bevel=-0.4,
    )
    canvas.lattice(
        screws, (count, 1), (pitch, 3 * radius), angle, (0.8 * radius, 0.18 * radius), gap
    )
    return holes + along * (np.arange(count)[:, None] - (count - 1) / 2) * pitch


def screw(canvas: Canvas, rng: Rng, at: np.ndarray, radius: float) -> None:
    """A head with a slot or a cross, and its shadow."""
    canvas.disc(at + 0.25 * radius, radius, (0, 0, 0), opacity=0.4)
    canvas.disc(at, radius, random_gray(rng), bevel=rng.uniform(-0.7, 0.7))
    slot, turn = random_gray(rng, 0.0, 0.4), rng.uniform(-np.pi, np.pi)
    for k in range(rng.integers(0, 3)):
        canvas.box(at, (0.75 * radius, 0.17 * radius), turn + k * np.pi / 2, slot)


def label(canvas: Canvas, rng: Rng) -> None:
    """A sticker with rows of text-like marks; or large letters printed on the ground itself."""
    w = canvas.width
    center, angle = rng.uniform((0, 0), (w, canvas.height)), rng.normal(0, 0.5)
    half = rng.uniform((0.04 * w, 0.02 * w), (0.16 * w, 0.08 * w)) * rng.choice(
        [1.0, 2.5], p=[0.8, 0.2]
    )
    paper, ink = random_gray(rng, 0.75, 1.0), random_gray(rng, 0.0, 0.3)
    if rng.random() < 0.3:
        paper, ink = ink, paper
    if rng.random() < 0.75:
        canvas.box(center, half, angle, paper, corner=0.004 * w)
    rows = int(rng.integers(1, 5))
    for row in range(rows):
        _text_row(
            canvas,
            rng,
            center + axes(angle)[1] * (row + 0.5 - rows / 2) * 1.7 * half[1] / rows,
            angle,
            0.85 * half[0],
            0.55 * half[1] / rows,
            ink,
        )


def _text_row(
    canvas: Canvas,
    rng: Rng,
    middle: np.ndarray,
    angle: float,
    reach: float,
    height: float,
    ink: Color,
) -> None:
    """Letters of one upright and some lying bars, ``height`` px above and below ``middle``."""
    along, across = axes(angle)
    stroke = max(0.22 * height, 0.5)
    if height < 1.5:  # too small to read: a line will do
        canvas.box(middle, (reach, stroke), angle, ink, opacity=0.6)
        return
    bars, x = [np.zeros((0, 2))], -reach
    while x < reach:
        size = height * rng.uniform(0.8, 1.5)
        stem = x + size * rng.choice([0.0, 0.5, 1.0])
        bars.append(_dotted((stem, -height), (stem, height), stroke))
        levels = rng.choice([-1, 0, 1], rng.integers(0, 3), replace=False) * (height - stroke)
        bars += [_dotted((x, level), (x + size, level), stroke) for level in levels]
        x += size + height * (0.7 if rng.random() < 0.85 else 2.0)
    uv = np.concatenate(bars)
    points = canvas.rgb.new_tensor(middle + uv[:, :1] * along + uv[:, 1:] * across)
    canvas.drops(
        points,
        points.new_full((len(points),), stroke),
        points.new_tensor(ink).expand(len(points), 3),
    )


def _dotted(a: tuple[float, float], b: tuple[float, float], stroke: float) -> np.ndarray:
    """Points (n, 2) along a bar, close enough that dots of radius ``stroke`` join."""
    n = int(np.hypot(b[0] - a[0], b[1] - a[1]) / stroke) + 2
    return np.linspace(a, b, n)


def _square(rng: Rng) -> float:
    """Along the picture's edges, slightly turned."""
    return float(rng.choice([0.0, np.pi / 2]) + rng.normal(0, 0.12))
