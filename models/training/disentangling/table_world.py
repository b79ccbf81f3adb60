"""A table with a harness on it: what a camera sees of it, and what an action does to it: to learn
from and to measure.

Sections are rigid pieces that turn about the place that is held, as the thesis assumes (6.7), but
the arms hold and turn with errors. A piece that lies under another one cannot be taken away: the
move fails.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from models.disentangling.plan import Action
from models.disentangling.rigid_piece import Pivot, body_of, turned
from models.geometry.polylines import arc_lengths
from models.synthesis.harness import FREE, Harness, HarnessParams, TrueSection
from models.synthesis.harness_curves import STEP_PX, Meeting, meetings, near_pairs
from models.synthesis.harness_growth import make_harness
from models.synthesis.harness_masks import MaskParams
from models.topology import order
from models.topology.scene import BranchPoint, Crossing, EndKind, Place, Section, Topology

SEEN = MaskParams(connectors=0, clips=0.2, tape=0.2, gaps=0, specks=0.1, coarse=0.2, rough=0.6)
"""What a camera makes of a mask on this table."""
HOLD_ERROR_PX = 2.0
TURN_ERROR_DEG = 3.0
_TOLD_APART_PX = 2.5
HAND_PX = 18.0
"""A gripper this near to a branch-point holds it."""


@dataclass(frozen=True)
class Outcome:
    """``moved``: False where the piece could not be taken away."""

    harness: Harness
    moved: bool


def one_crossing(rng: np.random.Generator, crossings: int) -> Harness:
    """A harness of one to four branch-points in which so many crossings lie."""
    params = HarnessParams(
        branch_points=(1, 4),
        harnesses=(1, 1),
        cables=(0, 0),
        cycle_share=0.0,
        crossings=(crossings, crossings),
        width_share=(0.012, 0.035),
    )
    harness = make_harness(rng, params)
    return replace(
        harness, a_over=tuple(bool(v) for v in rng.integers(0, 2, len(harness.crossings)))
    )


def seen_points(harness: Harness) -> order.Surface:
    """Points in space along the sections: the upper one of a crossing is nearer, the lower one is
    hidden there."""
    xy, depth = [], []
    for k, section in enumerate(harness.sections):
        at = STEP_PX * np.arange(len(section.xy))
        height, hidden = np.zeros(len(at)), np.zeros(len(at), bool)
        for m, a_over in zip(harness.crossings, harness.a_over, strict=True):
            for who, where, over in ((m.a, m.at_a, a_over), (m.b, m.at_b, not a_over)):
                if who == k:
                    other = harness.sections[m.b if who == m.a else m.a].width
                    near = np.abs(at - where)
                    if over:
                        height = np.maximum(height, 0.006 * np.exp(-((near / (2 * other)) ** 2)))
                    else:
                        hidden |= near < 0.6 * other / m.sine
        xy.append(section.xy[~hidden])
        depth.append(1.0 - height[~hidden])
    return order.points(np.concatenate(xy), np.concatenate(depth))


def truth(harness: Harness) -> Topology:
    """The topology as it is."""
    height, across = harness.size

    def kind(xy: np.ndarray, branch: int) -> EndKind:
        inside = 2 < xy[0] < across - 3 and 2 < xy[1] < height - 3
        return "branch" if branch != FREE else "free" if inside else "border"

    sections = tuple(
        Section(
            s.xy,
            s.width,
            float(arc_lengths(s.xy)[-1]),
            (kind(s.xy[0], s.ends[0]), kind(s.xy[-1], s.ends[1])),
            s.ends,
        )
        for s in harness.sections
    )
    branches = tuple(
        BranchPoint(
            (float(x), float(y)),
            tuple(i for i, s in enumerate(harness.sections) for e in s.ends if e == b),
            1.0,
        )
        for b, (x, y) in enumerate(harness.branch_xy)
    )
    crossings = []
    for m, a_over in zip(harness.crossings, harness.a_over, strict=True):
        one, other = (
            Place(w, min(1.0, at / sections[w].length)) for w, at in ((m.a, m.at_a), (m.b, m.at_b))
        )
        over, under = (one, other) if a_over else (other, one)
        crossings.append(Crossing((float(m.xy[0]), float(m.xy[1])), over, under, 1.0, 1.0))
    none = np.zeros(0)
    return Topology(
        harness.size,
        "branched",
        sections,
        branches,
        tuple(crossings),
        np.zeros((0, 2)),
        none,
        np.zeros((0, 2)),
        np.zeros((0, 2), np.int64),
        none,
    )


def execute(harness: Harness, action: Action, rng: np.random.Generator) -> Outcome:
    """Do the action on the harness as it is, not as it was seen."""
    topology = truth(harness)
    pick = np.array(action.pick.xy)
    hold = np.array(action.hold.xy) + rng.normal(0, HOLD_ERROR_PX, 2)
    picked = int(np.argmin([np.hypot(*(s.xy - pick).T).min() for s in topology.sections]))
    pivot = _held(topology, hold, pick, picked)
    body = body_of(topology, pivot) if pivot is not None else None
    if pivot is None or body is None or _is_under(harness, topology, pivot):
        return Outcome(harness, False)
    turn = action.turn + np.deg2rad(rng.normal(0, TURN_ERROR_DEG))
    return Outcome(
        _turned(harness, pivot, [k for k, _ in body.moving[1:]], body.center, turn), True
    )


def _held(topology: Topology, hold: np.ndarray, pick: np.ndarray, picked: int) -> Pivot | None:
    """What the holding arm holds: the branch-point there, or a place along the section; what is
    picked moves."""
    away = [np.hypot(*(s.xy - hold).T).min() for s in topology.sections]
    section = int(np.argmin(away))
    line = topology.sections[section]
    lengths = arc_lengths(line.xy)
    held = float(lengths[np.hypot(*(line.xy - hold).T).argmin()])
    near = [
        b
        for b, p in enumerate(topology.branch_points)
        if np.hypot(*(np.array(p.xy) - hold)) < max(2.5 * line.width, HAND_PX)
    ]
    options = [
        Pivot(k, 0.0 if end == 0 else topology.sections[k].length, 1 if end == 0 else -1, b)
        for b in near
        for k in set(topology.branch_points[b].sections)
        for end in (0, 1)
        if topology.sections[k].branches[end] == b
    ] or [Pivot(section, held, side, -1) for side in (1, -1)]
    for option in options:
        body = body_of(topology, option)
        lines = [xy for k, xy in body.moving if k == picked and len(xy)] if body else []
        if lines and min(np.hypot(*(xy - pick).T).min() for xy in lines) < 12:
            return option
    return None


def _moving(pivot: Pivot, who: int, at: float, downstream: set[int]) -> bool:
    if who in downstream:
        return True
    return who == pivot.section and (at - pivot.at) * pivot.side > 0


def _is_under(harness: Harness, topology: Topology, pivot: Pivot) -> bool:
    """Whether something that rests lies on the piece."""
    body = body_of(topology, pivot)
    assert body is not None
    downstream = {k for k, _ in body.moving[1:]}
    for m, a_over in zip(harness.crossings, harness.a_over, strict=True):
        a, b = (_moving(pivot, w, at, downstream) for w, at in ((m.a, m.at_a), (m.b, m.at_b)))
        if a != b and (a if not a_over else b):
            return True
    return False


def _turned(
    harness: Harness, pivot: Pivot, downstream: list[int], center: np.ndarray, turn: float
) -> Harness:
    sections = list(harness.sections)
    branches = harness.branch_xy.copy()
    moved_branches = {b for k in downstream for b in sections[k].ends if b != FREE}
    for k in downstream:
        sections[k] = replace(sections[k], xy=turned(sections[k].xy, center, turn))
    own = sections[pivot.section]
    lengths = arc_lengths(own.xy)
    moves = (lengths - pivot.at) * pivot.side > 0
    sections[pivot.section] = replace(
        own, xy=np.where(moves[:, None], turned(own.xy, center, turn), own.xy)
    )
    far = own.ends[1 if pivot.side > 0 else 0]
    moved_branches |= {far} - {FREE}
    moved_branches -= {pivot.branch}
    for b in moved_branches:
        branches[b] = turned(branches[b], center, turn)
    return recounted(
        harness, tuple(sections), branches, lambda who, at: _moving(pivot, who, at, set(downstream))
    )


def recounted(
    before: Harness,
    sections: tuple[TrueSection, ...],
    branches: np.ndarray,
    moved: Callable[[int, float], bool],
) -> Harness:
    """The harness with its crossings found anew; those that were there keep their order, new ones
    have the moved piece on top. ``moved``: whether a section moved at an arc length."""
    known = [(m, o) for m, o in zip(before.crossings, before.a_over, strict=True)]
    found: list[Meeting] = []
    over = []
    for m in meetings([s.xy for s in sections]):
        shared = (
            (set(sections[m.a].ends) & set(sections[m.b].ends)) - {FREE} if m.a != m.b else set()
        )
        if any(np.hypot(*(m.xy - branches[e])) < 1.5 * sections[m.b].width + 6 for e in shared):
            continue
        if m.a == m.b and abs(m.at_a - m.at_b) < 3 * sections[m.a].width:
            continue
        found.append(m)
        same = [o for k, o in known if (k.a, k.b) == (m.a, m.b) and abs(k.at_a - m.at_a) < 12]
        over.append(same[0] if same else moved(m.a, m.at_a))
    return Harness(before.size, sections, branches, tuple(found), tuple(over))


def unclear(harness: Harness) -> int:
    """How many places nobody could read from a mask: sections that touch without crossing there,
    and crossings that lie out of the picture, at its border, or right beside a branch-point or
    another crossing."""
    height, across = harness.size
    count = 0
    for k, m in enumerate(harness.crossings):
        width = harness.sections[m.a].width + harness.sections[m.b].width
        reach = 0.6 * width / max(m.sine, 0.3) + 6
        others = [*harness.branch_xy, *(o.xy for n, o in enumerate(harness.crossings) if n != k)]
        x, y = m.xy
        inside = min(x, y, across - 1 - x, height - 1 - y)
        count += inside < width / 2 or any(np.hypot(*(m.xy - p)) < reach for p in others)
    pairs = [(a, b) for a in range(len(harness.sections)) for b in range(a, len(harness.sections))]
    return count + sum(_touch(harness, a, b) for a, b in pairs)


def _touch(harness: Harness, a: int, b: int) -> bool:
    """Whether two sections (or one, itself) are nearer than a camera tells apart, away from where
    they cross and from a branch-point of both."""
    one, other = harness.sections[a], harness.sections[b]
    width = (one.width + other.width) / 2
    if np.any(one.xy.min(axis=0) - width > other.xy.max(axis=0)) or np.any(
        other.xy.min(axis=0) - width > one.xy.max(axis=0)
    ):
        return False
    at_a, at_b = near_pairs(one.xy, other.xy, width + _TOLD_APART_PX)
    known = np.abs(at_a - at_b) < 4 * one.width + 12 if a == b else np.zeros(len(at_a), bool)
    for m in harness.crossings:
        if (m.a, m.b) == (a, b):
            reach = 2 * width / max(m.sine, 0.3) + 6
            known |= (np.abs(at_a - m.at_a) < reach) & (np.abs(at_b - m.at_b) < reach)
            known |= (a == b) & (np.abs(at_a - m.at_b) < reach) & (np.abs(at_b - m.at_a) < reach)
    for i, e in enumerate(one.ends):
        for j, f in enumerate(other.ends):
            if a != b and e == f != FREE:
                spots = [end * STEP_PX * (len(s.xy) - 1) for s, end in ((one, i), (other, j))]
                known |= (np.abs(at_a - spots[0]) < 5 * width + 4) & (
                    np.abs(at_b - spots[1]) < 5 * width + 4
                )
    return not bool(known.all())


def nearest_section(harness: Harness, xy: np.ndarray) -> int:
    """The true section nearest to most of ``(n, 2)`` points."""
    away = np.stack([cKDTree(s.xy).query(xy)[0] for s in harness.sections])
    return int(np.bincount(away.argmin(axis=0)).argmax())
