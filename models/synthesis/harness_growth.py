"""Random harnesses.

Strategy: a harness grows as a tree of sections. Each new section is drawn at random and kept if it
fits: it stays clear of what is there, except at the branch-point it leaves and where it clearly
crosses. So what the labels state is also what the mask shows. Sections that leave a bundle and come
back close cycles afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at, resample
from models.synthesis.harness import FREE, Fork, Harness, HarnessParams, TrueSection
from models.synthesis.harness_curves import (
    STEP_PX,
    Meeting,
    bezier,
    meetings,
    near_pairs,
    sharpest_radius,
    wander,
)

_LEAST_SINE = 0.42


@dataclass
class _Growth:
    """What has grown so far."""

    rng: np.random.Generator
    params: HarnessParams
    sections: list[TrueSection] = field(default_factory=list)
    branches: list[FloatArray] = field(default_factory=list)
    crossed: list[FloatArray] = field(default_factory=list)
    """Where accepted sections cross."""


@dataclass(frozen=True, eq=False)
class _Bud:
    """Where a section starts: point, heading, width, branch-point, and how it swings out (units of
    1 / radius)."""

    xy: FloatArray
    heading: float
    width: float
    branch: int
    turn: float = 0.0


class _StuckError(Exception):
    """No section fits any more."""


def make_harness(rng: np.random.Generator, params: HarnessParams) -> Harness:
    """One scene; everything random comes from ``rng``. Scenes that do not work out are drawn
    again."""
    while True:
        growth = _Growth(rng, params)
        try:
            _grow(growth)
        except _StuckError:
            continue
        harness = _finished(growth)
        if params.crossings[0] <= len(harness.crossings) <= params.crossings[1]:
            return harness


def _grow(growth: _Growth) -> None:
    rng, params = growth.rng, growth.params
    wanted = int(rng.integers(params.branch_points[0], params.branch_points[1] + 1))
    harnesses = int(rng.integers(params.harnesses[0], params.harnesses[1] + 1))
    low, high = np.log(params.width_share)
    width = float(np.exp(rng.uniform(low, high))) * params.size[1]
    for share in np.array_split(np.zeros(wanted), harnesses):
        _grow_tree(growth, len(share), width * rng.uniform(0.8, 1.25))
    for _ in range(int(rng.integers(params.cables[0], params.cables[1] + 1))):
        _grow_tree(growth, 0, width * rng.uniform(0.4, 1.0))
    if growth.branches and rng.random() < params.cycle_share:
        _close_cycle(growth)


def _grow_tree(growth: _Growth, wanted: int, width: float) -> None:
    """One harness with so many branch-points."""
    rng, (height, across) = growth.rng, growth.params.size
    if rng.random() < 0.5:
        start = np.array([rng.uniform(0.1, 0.9) * across, rng.uniform(0.1, 0.9) * height])
        heading = rng.uniform(-np.pi, np.pi)
    else:
        start, heading = _from_border(rng, height, across)
    buds = [_Bud(start, heading, width, FREE)]
    if wanted > 1 and rng.random() < 0.5:
        wanted -= 1
        buds = _two_ended(growth, buds[0])
    while buds:
        bud = buds.pop(int(rng.integers(len(buds))))
        branches = wanted > 0 and (not buds or rng.random() < 0.6)
        section = _fitting_section(growth, bud, branches)
        if branches:
            wanted -= 1
            growth.branches.append(section.xy[-1])
            section = replace(section, ends=(bud.branch, len(growth.branches) - 1))
            buds += _fork(rng, section, len(growth.branches) - 1)
        growth.sections.append(section)


def _two_ended(growth: _Growth, bud: _Bud) -> list[_Bud]:
    """A bundle that forks at its start too, as cables that are tied together for a while do."""
    if not _well_inside(growth, bud.xy, bud):
        raise _StuckError
    growth.branches.append(bud.xy)
    here = len(growth.branches) - 1
    back = np.array([np.cos(bud.heading), np.sin(bud.heading)])
    stem = TrueSection(
        bud.xy + np.array([[2.0], [1.0], [0.0]]) * STEP_PX * back, bud.width, (FREE, here)
    )
    return [replace(bud, branch=here), *_fork(growth.rng, stem, here)]


def _from_border(rng: np.random.Generator, height: int, across: int) -> tuple[FloatArray, float]:
    side = int(rng.integers(4))
    along = rng.uniform(0.15, 0.85)
    places = [
        (along * across, -1.0),
        (across + 1.0, along * height),
        (along * across, height + 1.0),
        (-1.0, along * height),
    ]
    return np.array(places[side]), float((0.5, 1.0, -0.5, 0.0)[side] * np.pi + rng.normal(0, 0.4))


def _fork(rng: np.random.Generator, section: TrueSection, branch: int) -> list[_Bud]:
    """The two sections that leave a branch-point: lanes of a flat bundle, a thin one off a trunk,
    or a Y."""
    step = section.xy[-1] - section.xy[-3]
    heading = float(np.arctan2(step[1], step[0]))
    normal = np.array([-np.sin(heading), np.cos(heading)])
    trunk, end = section.width, section.xy[-1]
    kind: Fork = rng.choice(["lanes", "tee", "fork"], p=[0.45, 0.3, 0.25])
    side = float(rng.choice([-1, 1]))
    least = 0.008 * 640
    if kind == "lanes":
        share = rng.uniform(0.35, 0.65)
        sum_of = trunk * rng.uniform(1.0, 1.25)
        widths = [max(sum_of * share, least), max(sum_of * (1 - share), least)]
        swings = rng.permutation([rng.uniform(0.5, 1.0), rng.uniform(0.0, 0.8)])
        return [
            _Bud(
                end + sign * side * max(trunk - w, 0) / 2 * normal,
                heading + sign * side * rng.uniform(0, 0.3),
                w,
                branch,
                sign * side * float(swing),
            )
            for sign, w, swing in zip((1, -1), widths, swings, strict=True)
        ]
    if kind == "tee":
        off = side * np.deg2rad(rng.uniform(35, 100))
        through = _Bud(
            end, heading + rng.normal(0, 0.1), max(trunk * rng.uniform(0.75, 1.0), least), branch
        )
        return [
            through,
            _Bud(end, heading + off, max(trunk * rng.uniform(0.35, 0.8), least), branch),
        ]
    width = max(trunk * rng.uniform(0.6, 0.95), least)
    other = max(trunk * rng.uniform(0.6, 0.95), least)
    angles = np.deg2rad(rng.uniform(18, 55, 2))
    return [
        _Bud(end, heading + angles[0] * side, width, branch, 0.3 * side),
        _Bud(end, heading - angles[1] * side, other, branch, -0.3 * side),
    ]


def _fitting_section(growth: _Growth, bud: _Bud, branches: bool) -> TrueSection:
    """A section from the bud that fits; shorter ones are tried where long ones do not. Raises
    _StuckError."""
    rng, longest = growth.rng, max(growth.params.size)
    length = rng.uniform(0.14, 0.4) * longest if branches else rng.uniform(0.2, 1.0) * longest
    least = 5 * bud.width + 24
    for _ in range(14):
        radius = bud.width * rng.uniform(2.2, 6.0) + 8
        points = wander(rng, bud.xy, bud.heading, max(length, least), radius, bud.turn)
        section = TrueSection(
            _in_view(points, growth.params.size, bud.width), bud.width, (bud.branch, FREE)
        )
        whole = len(section.xy) == len(points)
        long_enough = STEP_PX * len(section.xy) >= least
        ends_well = not branches or (whole and _well_inside(growth, section.xy[-1], bud))
        if long_enough and ends_well and _fits(growth, section):
            return section
        length *= 0.85
    raise _StuckError


def _in_view(points: FloatArray, size: tuple[int, int], width: float) -> FloatArray:
    """The points up to where the section has left the picture by its width."""
    height, across = size
    out = np.any((points < -width) | (points > np.array([across, height]) + width), axis=1)
    left = int(np.argmax(out)) if out.any() else len(points)
    return points[:left]


def _well_inside(growth: _Growth, xy: FloatArray, bud: _Bud) -> bool:
    height, across = growth.params.size
    margin = 2 * bud.width + 12
    inside = margin < xy[0] < across - margin and margin < xy[1] < height - margin
    apart = all(np.hypot(*(xy - other)) > 5 * bud.width + 16 for other in growth.branches)
    return bool(inside and apart)


def _fits(growth: _Growth, section: TrueSection) -> bool:
    """Whether the section is clear of all others but at its branch-points and at clear crossings;
    those are noted."""
    curves = [s.xy for s in growth.sections] + [section.xy]
    new = len(curves) - 1
    met = [m for m in meetings(curves) if m.b == new and not _at_shared(growth, section, m)]
    if any(m.sine < _LEAST_SINE or not _room(growth, section, m, met) for m in met):
        return False
    gap = max(2.5, section.width * growth.rng.uniform(0.15, 0.8))
    if not all(_clear(growth, section, k, met, gap) for k in range(len(growth.sections) + 1)):
        return False
    growth.crossed += [m.xy for m in met]
    return True


def _at_shared(growth: _Growth, section: TrueSection, met: Meeting) -> bool:
    """Curves that leave one branch-point may touch right there; that is no crossing."""
    shared = [
        e
        for e in section.ends
        if e != FREE and met.a < len(growth.sections) and e in growth.sections[met.a].ends
    ]
    return any(np.hypot(*(met.xy - growth.branches[e])) < 1.5 * section.width + 6 for e in shared)


def _room(growth: _Growth, section: TrueSection, met: Meeting, others: list[Meeting]) -> bool:
    """Whether the crossing is apart from branch-points, ends of sections and other crossings."""
    other = growth.sections[met.a].width if met.a < len(growth.sections) else section.width
    reach = 0.75 * (section.width + other) / met.sine + 0.6 * max(section.width, other) + 6
    ends = [s.xy[k] for s in (*growth.sections, section) for k in (0, -1)]
    near = [*growth.branches, *ends, *growth.crossed, *(m.xy for m in others if m is not met)]
    return all(np.hypot(*(met.xy - p)) > reach for p in near)


def _clear(growth: _Growth, section: TrueSection, k: int, met: list[Meeting], gap: float) -> bool:
    """Whether the section keeps the gap to section ``k``, or to itself where ``k`` is its own
    index."""
    itself = k == len(growth.sections)
    other = section if itself else growth.sections[k]
    mine, theirs = near_pairs(section.xy, other.xy, (section.width + other.width) / 2 + gap)
    reach_along = 4 * section.width + 12 if itself else 0.0
    allowed: BoolArray = np.abs(mine - theirs) < reach_along
    for m in met:
        if m.a != k:
            continue
        reach = ((section.width + other.width) / 2 + gap) * 1.5 / m.sine + 6
        allowed |= (np.abs(mine - m.at_b) < reach) & (np.abs(theirs - m.at_a) < reach)
        if itself:
            allowed |= (np.abs(mine - m.at_a) < reach) & (np.abs(theirs - m.at_b) < reach)
    if not itself:
        allowed |= _near_shared(section, other, mine, theirs, gap)
    return bool(allowed.all())


def _near_shared(
    section: TrueSection, other: TrueSection, mine: FloatArray, theirs: FloatArray, gap: float
) -> BoolArray:
    """Pairs near a branch-point that both sections have; bundles may part slowly."""
    reach = 2.5 * (section.width + other.width) + 2 * gap
    near = np.zeros(len(mine), bool)
    for my_end, place in zip(section.ends, (0.0, STEP_PX * (len(section.xy) - 1)), strict=True):
        for their_end, spot in zip(other.ends, (0.0, STEP_PX * (len(other.xy) - 1)), strict=True):
            if my_end != FREE and my_end == their_end:
                near |= (np.abs(mine - place) < reach) & (np.abs(theirs - spot) < reach)
    return near


def _close_cycle(growth: _Growth) -> None:
    """Another section between two places of the harness: it leaves a bundle and comes back. None if
    none fits."""
    rng = growth.rng
    for _ in range(12):
        i, j = (int(k) for k in rng.integers(len(growth.sections), size=2))
        first, second = growth.sections[i], growth.sections[j]
        at_i, at_j = (
            float(rng.uniform(0.2, 0.8)) * STEP_PX * (len(s.xy) - 1) for s in (first, second)
        )
        if i == j and abs(at_i - at_j) < 10 * first.width:
            continue
        trial = _with_cycle(growth, (i, at_i), (j, at_j), 0.6 * min(first.width, second.width))
        if trial is not None:
            growth.sections, growth.branches = trial.sections, trial.branches
            return


def _with_cycle(
    growth: _Growth, start: tuple[int, float], end: tuple[int, float], width: float
) -> _Growth | None:
    trial = _Growth(
        growth.rng,
        growth.params,
        list(growth.sections),
        list(growth.branches),
        list(growth.crossed),
    )
    tangents = []
    for (k, at), sign in ((start, 1.0), (end, -1.0)):
        points = growth.sections[k].xy
        lengths = arc_lengths(points)
        here, ahead = point_at(points, lengths, np.array([at, at + STEP_PX]))
        angle = np.arctan2(*(ahead - here)[::-1]) + sign * growth.rng.choice(
            [-1, 1]
        ) * growth.rng.uniform(0.4, 1.1)
        tangents.append(sign * np.array([np.cos(angle), np.sin(angle)]))
        if not _well_inside(trial, here, _Bud(here, 0.0, growth.sections[k].width, FREE)):
            return None
        trial.branches.append(here)
    first, last = trial.branches[-2:]
    pull = float(np.hypot(*(last - first))) * growth.rng.uniform(0.4, 1.2)
    loop = TrueSection(
        bezier(first, first + pull * tangents[0], last + pull * tangents[1], last),
        max(width, 5.0),
        (len(trial.branches) - 2, len(trial.branches) - 1),
    )
    # The later place first: splitting keeps the indices and arc lengths of what lies before it.
    for (k, at), branch in sorted(
        ((start, loop.ends[0]), (end, loop.ends[1])), key=lambda p: p[0], reverse=True
    ):
        _split(trial, k, at, branch)
    radius = 1.6 * loop.width + 6
    return (
        trial
        if sharpest_radius(loop.xy) > radius and _fits(trial, loop) and _add(trial, loop)
        else None
    )


def _add(growth: _Growth, section: TrueSection) -> bool:
    growth.sections.append(section)
    return True


def _split(growth: _Growth, k: int, at: float, branch: int) -> None:
    old = growth.sections[k]
    lengths = arc_lengths(old.xy)
    before = np.concatenate((old.xy[lengths < at], growth.branches[branch][None]))
    after = np.concatenate((growth.branches[branch][None], old.xy[lengths > at]))
    growth.sections[k] = TrueSection(_even(before), old.width, (old.ends[0], branch))
    growth.sections.insert(
        k + 1,
        TrueSection(_even(after), old.width * growth.rng.uniform(0.75, 1.1), (branch, old.ends[1])),
    )


def _even(points: FloatArray) -> FloatArray:
    return resample(points, max(4, round(float(arc_lengths(points)[-1]) / STEP_PX) + 1))


def _finished(growth: _Growth) -> Harness:
    """The labels of what has grown; crossings outside the picture do not count."""
    height, across = growth.params.size
    sections = tuple(growth.sections)
    found = []
    for m in meetings([s.xy for s in sections]) if sections else []:
        inside = 0 <= m.xy[0] < across and 0 <= m.xy[1] < height
        shared = set(sections[m.a].ends) & set(sections[m.b].ends) - {FREE} if m.a != m.b else set()
        apart = all(
            np.hypot(*(m.xy - growth.branches[e])) > 1.5 * sections[m.b].width + 6 for e in shared
        )
        if inside and apart:
            found.append(m)
    over = tuple(bool(v) for v in np.random.default_rng(len(found)).integers(0, 2, len(found)))
    branches = np.array(growth.branches).reshape(-1, 2)
    return Harness(growth.params.size, sections, branches, tuple(found), over)
