"""How the cables of one picture lie: alone, side by side, as a harness, as a coil, out of a
terminal row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.synthesis.curves import FloatArray, axes, coil, parallel_curve, random_curve
from models.synthesis.ribbons import STEP_PX

Rng = np.random.Generator
Course = tuple[FloatArray, float]
"""A curve (m, 3) and its width in px."""


Arrangement = Callable[[Rng, tuple[int, int], Callable[[], float], int], "Layout"]
"""From the picture's (height, width), a source of widths and about how many cables."""


@dataclass(frozen=True)
class Layout:
    """``courses`` of the cables; ``trunk`` the number of one that wraps the others as tape or
    conduit does, or ``None``; ``ties_xy`` where bundles are tied, with heading and half-width."""

    courses: tuple[Course, ...]
    trunk: int | None = None
    ties: tuple[tuple[FloatArray, float, float], ...] = ()


def fan(rng: Rng, size: tuple[int, int], width: Callable[[], float], count: int) -> Layout:
    """Two to ``count`` + 3 nearly straight strands about one axis with one common bow: side by
    side, or meeting and crossing at small angles; some end in the picture."""
    thick, number = width(), int(rng.integers(2, count + 4))
    along, across = axes(rng.uniform(-np.pi, np.pi))
    middle = rng.uniform(np.array(size[::-1]) * 0.15, np.array(size[::-1]) * 0.85)
    reach = 0.8 * float(np.hypot(*size))
    starts, stops = (
        np.sort(rng.uniform(-1, 1, number)) * thick * number * rng.uniform(0.5, 3.0)
        for _ in range(2)
    )
    if rng.random() < 0.4:
        rng.shuffle(stops)
    bow, t = rng.normal(0, 0.1) * reach, np.linspace(-1, 1, int(2 * reach / STEP_PX))
    courses: list[Course] = []
    for start, stop in zip(starts, stops, strict=True):
        wave = 0.3 * thick * np.sin(rng.uniform(1, 4) * t + rng.uniform(0, 6))
        offset = (start + (stop - start) * (t + 1) / 2) + bow * (1 - t**2) + wave
        height = np.full(len(t), rng.uniform(0, 1))
        curve = np.column_stack(
            [middle + t[:, None] * reach * along + offset[:, None] * across, height]
        )
        first = int(rng.uniform(0.2, 0.6) * len(t)) if rng.random() < 0.2 else 0
        courses.append(
            (curve[first:].astype(np.float32), float(thick * np.exp(rng.normal(0, 0.05))))
        )
    return Layout(tuple(courses))


def ribbon_cable(rng: Rng, size: tuple[int, int], width: Callable[[], float], count: int) -> Layout:
    """A flat cable: three to sixteen equal strands side by side without a gap, and a few others."""
    number = int(rng.integers(3, 17))
    thick = min(width() * 0.5, 0.35 * size[1] / number)
    middle = random_curve(rng, size, thick * number)
    gaps = thick * (np.arange(number) - (number - 1) / 2)
    flat = [(parallel_curve(rng, middle, gap, stray=0.0), thick) for gap in gaps]
    return Layout((*flat, *loose(rng, size, width, min(count, 2)).courses))


def random_layout(
    rng: Rng,
    size: tuple[int, int],
    width_share: tuple[float, float],
    max_cables: int,
    arranged: Arrangement | None = None,
) -> Layout:
    """``size`` (height, width) px; ``width_share`` bounds of a cable's width over the picture's;
    ``arranged`` as asked for, else loose, as a harness or coiled."""
    low, high = np.log(width_share)
    typical = float(np.exp(rng.uniform(low, high)))

    def width() -> float:
        return float(np.clip(typical * np.exp(rng.normal(0.0, 0.25)), *width_share) * size[1])

    if arranged is not None:
        return arranged(rng, size, width, int(rng.integers(1, max_cables + 1)))
    arrange = (
        (loose, harness, coiled)[rng.choice(3, p=[0.80, 0.14, 0.06])] if max_cables >= 3 else loose
    )
    return arrange(rng, size, width, int(rng.integers(1, max_cables + 1)))


def cut_through(rng: Rng, layout: Layout, share: float) -> Layout:
    """This ``share`` of the cables becomes two whose ends face each other, up to 25 widths apart;
    wrapped ones stay."""
    if layout.trunk is not None:
        return layout
    courses: list[Course] = []
    for curve, thick in layout.courses:
        gap = round(thick * float(np.exp(rng.uniform(0.0, np.log(25.0)))) / STEP_PX)
        if rng.random() < share and len(curve) > 3 * gap:
            at = int(rng.integers(gap, len(curve) - 2 * gap))
            courses += [(curve[:at], thick), (curve[at + gap :], thick)]
        else:
            courses.append((curve, thick))
    return replace(layout, courses=tuple(courses))


def loose(rng: Rng, size: tuple[int, int], width: Callable[[], float], count: int) -> Layout:
    """Each by itself; now and then one runs beside the one before."""
    courses: list[Course] = []
    for _ in range(count):
        thick = width()
        if courses and rng.random() < 0.15:
            before, its_width = courses[-1]
            gap = (thick + its_width) / 2 * rng.uniform(1.0, 1.8) * rng.choice([-1, 1])
            courses.append((parallel_curve(rng, before, gap), thick))
        else:
            courses.append((random_curve(rng, size, thick), thick))
    return Layout(tuple(courses))


def harness(rng: Rng, size: tuple[int, int], width: Callable[[], float], count: int) -> Layout:
    """``count`` - 1 strands (two or more) side by side that fan out after a while, tied, or wrapped
    in tape up to there (the tape counts as one more)."""
    count, thick = max(count - 1, 2), width() * 0.8
    middle = random_curve(rng, size, thick * count * 0.7)
    progress = np.linspace(0, 1, len(middle))
    leave = rng.uniform(0.2, 1.1)
    courses: list[Course] = []
    for k in range(count):
        gap = thick * rng.uniform(0.95, 1.05) * (k - (count - 1) / 2)
        spread = 1 + rng.uniform(1.0, 8.0) * np.clip(progress - leave, 0, None) / 0.3
        courses.append((parallel_curve(rng, middle, gap * spread, stray=0.08), thick))
    if rng.random() < 0.35:
        stop = int(np.clip(leave, 0.15, 0.7) * len(middle))
        trunk = middle[:stop].copy()
        trunk[:, 2] = 2.0  # above everything that it wraps
        return Layout((*courses, (trunk, thick * count * rng.uniform(0.7, 1.05))), trunk=count)
    return Layout(tuple(courses), ties=_ties(rng, middle, leave, thick * count / 2))


def coiled(rng: Rng, size: tuple[int, int], width: Callable[[], float], count: int) -> Layout:
    """One cable wound up, and a few others."""
    thick = min(width(), 0.04 * size[1])
    return Layout(
        ((coil(rng, size, thick), thick), *loose(rng, size, width, min(count, 3) - 1).courses)
    )


def wired(
    rng: Rng, size: tuple[int, int], holes: FloatArray, heading: float, pitch: float
) -> Layout:
    """Cables out of some of the ``holes`` (n, 2) of a terminal row, leaving at about
    ``heading``."""
    thick = pitch * rng.uniform(0.25, 0.75)
    used = holes[rng.random(len(holes)) < rng.uniform(0.3, 1.0)]
    starts = [(hole, heading + float(rng.normal(0, 0.2))) for hole in used]
    return Layout(tuple((random_curve(rng, size, thick, start=start), thick) for start in starts))


def _ties(
    rng: Rng, middle: FloatArray, leave: float, half: float
) -> tuple[tuple[FloatArray, float, float], ...]:
    if rng.random() < 0.4:
        return ()
    ties = []
    for at in rng.uniform(0.02, min(leave, 1.0) - 0.02, rng.integers(1, 5)) if leave > 0.1 else ():
        k = int(np.clip(at * len(middle), 2, len(middle) - 3))
        along = middle[k + 2, :2] - middle[k - 2, :2]
        ties.append((middle[k, :2], float(np.arctan2(along[1], along[0])), half))
    return tuple(ties)
