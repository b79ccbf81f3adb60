"""The dual-arm move that removes a crossing (thesis Algorithm 7, section 6.7), simulated before it is proposed.

Strategy: one arm holds a place of the harness, the other takes the piece beyond it and turns it about that place: the
thesis holds the branch-point that the upper section hangs on. Here every branch-point and a few places along the
section are tried, for the piece on either side, over all angles; the piece is swept as a rigid body. What counts is how
many crossings are left, how sure it is that the piece lies on top, how far it is then from everything else, and how
little it has to turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths, point_at
from models.topology.bodies import Body, Pivot, body_of, intersections, segments, turned
from models.topology.scene import Crossing, Place, Topology


@dataclass(frozen=True)
class DisentangleParams:
    """``step_deg`` and ``most_deg``: angles tried; ``clearance_widths``: wished distance to other sections after the
    move; ``margin_px``: how far outside the picture the piece may end; ``at_most``: actions proposed."""

    step_deg: float = 5.0
    most_deg: float = 175.0
    clearance_widths: float = 1.0
    margin_px: float = 40.0
    at_most: int = 8


@dataclass(frozen=True, eq=False)
class Grasp:
    """``angle``: radians, along the section; the gripper closes across it."""

    xy: tuple[float, float]
    angle: float


@dataclass(frozen=True, eq=False)
class Action:
    """``crossing`` and ``section``: indices; ``turn`` radians about ``hold``; ``trajectory``: ``(n, 2)`` arc from
    ``pick`` to ``place``; ``after``: crossings that the simulation counts then, of ``before``; ``passed``: sections
    that the piece is lifted over; ``certainty``: probability that it lies on top wherever it crosses something."""

    crossing: int
    section: int
    branch: int
    hold: Grasp
    pick: Grasp
    place: Grasp
    trajectory: FloatArray
    turn: float
    before: int
    after: int
    passed: tuple[int, ...]
    clearance: float
    certainty: float
    score: float
    leaves_view: bool


_MOST_CROSSINGS = 24
_MOST_PIVOTS = 160
_SIDEWAYS = float(np.tan(np.deg2rad(20)))
_TURN_ERROR = float(np.sin(np.deg2rad(3)))
"""How far a turned place may end from where it should, per px from the place held."""
_HAND_PX = 12.0
"""What a gripper needs beside the strand that it closes on."""
_LEAST_CERTAINTY = 0.15
"""A piece that more probably lies under something is left alone: it would drag that along."""


def plan(topology: Topology, params: DisentangleParams | None = None) -> list[Action]:
    """Actions that leave fewer crossings than there are, best first; empty if none does.

    At most 24 crossings, those nearest to a free end first as they are easiest to undo (6.7), and 160 places to hold
    are looked at.
    """
    settings = params or DisentangleParams()
    order = sorted(range(len(topology.crossings)), key=lambda k: _depth(topology, topology.crossings[k]))
    order = order[:_MOST_CROSSINGS]
    found = (_best_turn(topology, order, pivot, settings) for pivot in _pivots(topology, order)[:_MOST_PIVOTS])
    actions = sorted((a for a in found if a is not None), key=lambda a: -a.score)
    return actions[: settings.at_most]


def _depth(topology: Topology, crossing: Crossing) -> float:
    """Length from the crossing to the nearest free end along its sections; large where there is none."""
    found = [1e9]
    for place in (crossing.over, crossing.under):
        section = topology.sections[place.section]
        for end, share in ((0, place.u), (1, 1 - place.u)):
            if section.branches[end] < 0 and not section.closed:
                found.append(share * section.length)
    return min(found)


def _pivots(topology: Topology, order: Sequence[int]) -> list[Pivot]:
    """Where to hold: the branch-points of the sections that cross, places along these, then all branch-points."""
    pivots: list[Pivot] = []
    for k in order:
        crossing = topology.crossings[k]
        for place, other in ((crossing.over, crossing.under), (crossing.under, crossing.over)):
            pivots += _branch_pivots(topology, place.section) + _inner_pivots(topology, place, other)
    for section in range(len(topology.sections)):
        pivots += _branch_pivots(topology, section)
    return list(dict.fromkeys(pivots))


def _branch_pivots(topology: Topology, k: int) -> list[Pivot]:
    section = topology.sections[k]
    ends = ((0.0, 1, section.branches[0]), (section.length, -1, section.branches[1]))
    return [Pivot(k, at, side, branch) for at, side, branch in ends if branch >= 0]


def _inner_pivots(topology: Topology, place: Place, other: Place) -> list[Pivot]:
    """Places along the section, on both sides of the crossing; on a self-crossing between its two passes."""
    section = topology.sections[place.section]
    if section.closed:
        return []
    length, at = section.length, place.u * section.length
    gap = 1.5 * max(section.width, topology.sections[other.section].width) + _HAND_PX / 2
    stop = other.u * length if other.section == place.section else None
    pivots = []
    for side in (1, -1):
        end = 0.0 if side > 0 else length
        if stop is not None and min(at, end) < stop < max(at, end):
            end = stop
        for share in (0.2, 0.4, 0.6, 0.8) if abs(end - at) > 6 * gap else (0.5,):
            held = at + share * (end - at)
            if abs(held - at) > gap:
                pivots.append(Pivot(place.section, round(held, 3), side, -1))
    return pivots


def _best_turn(
    topology: Topology, order: Sequence[int], pivot: Pivot, params: DisentangleParams
) -> Action | None:  # fmt: skip
    """The best angle for one place to hold; None if no angle leaves fewer crossings, or the piece is held down."""
    body = body_of(topology, pivot)
    if body is None:
        return None
    parted = _parted(topology, order, body, pivot)
    certainty = _certainty(topology, body, pivot)
    if not parted or certainty < _LEAST_CERTAINTY:
        return None
    steps = np.arange(params.step_deg, params.most_deg + 1e-6, params.step_deg)
    angles = np.deg2rad(np.concatenate((-steps[::-1], steps)))
    before = len(topology.crossings)
    kept = before - len(_parted(topology, range(before), body, pivot))
    after = kept + np.array([len(_crossings_between(topology, body, float(a))) for a in angles])
    least = int(after.min())
    if least >= before:
        return None
    sure = _steady(after, len(steps)) == least
    value, turn, clearance = max(
        (_fitness(topology, body, pivot, float(a), params) for a in angles[sure if sure.any() else after == least]),
        key=lambda f: f[0],
    )
    score = certainty * (before - least) / before * (0.5 + 0.35 * value + (0.1 if pivot.branch >= 0 else 0.0))
    score *= (0.3 if body.leaves_view else 1.0) * (1 - 0.3 * _share_moved(body))
    k, place = parted[0]
    (hold, pick, placed, path), room = _grasps(topology, place, pivot, body, turn)
    score *= (0.3 + 0.7 * room) * (1.0 if sure.any() else 0.5)
    return Action(
        k, place.section, pivot.branch, hold, pick, placed, path, turn, before, least, _passed(topology, body, turn),
        clearance, certainty, float(score), body.leaves_view,
    )  # fmt: skip


def _steady(after: IntArray, half: int) -> IntArray:
    """The most crossings that are left at each angle or one step beside it: arms do not turn exactly. The first
    ``half`` angles turn one way, the others the other way."""
    beside = [np.pad(part, 1, mode="edge") for part in (after[:half], after[half:])]
    return np.concatenate([np.maximum(np.maximum(p[:-2], p[1:-1]), p[2:]) for p in beside])


def _parted(topology: Topology, order: Sequence[int], body: Body, pivot: Pivot) -> list[tuple[int, Place]]:
    """The crossings of which one pass moves and the other rests, with the one that moves."""
    found = []
    for k in order:
        moving = [
            p for p in (topology.crossings[k].over, topology.crossings[k].under) if _moves(topology, p, body, pivot)
        ]
        if len(moving) == 1:
            found.append((k, moving[0]))
    return found


def _moves(topology: Topology, place: Place, body: Body, pivot: Pivot) -> bool:
    """Whether a place of a section belongs to the piece that moves."""
    if place.section == pivot.section:
        return (place.u * topology.sections[place.section].length - pivot.at) * pivot.side > 0
    return any(k == place.section for k, _ in body.moving)


def _fitness(
    topology: Topology, body: Body, pivot: Pivot, angle: float, params: DisentangleParams
) -> tuple[float, float, float]:
    """How well the body lies at an angle (up to 1: clear of everything, in view, little turned), it, the clearance."""
    wished = max(params.clearance_widths * topology.sections[pivot.section].width, 1.0)
    clearance, share = _clearance(topology, body, angle, wished)
    fit = share * _in_view(topology, body, angle, params)
    return max(0.0, fit - 0.25 * abs(angle) / np.pi), angle, clearance


def _share_moved(body: Body) -> float:
    """Share of all length that moves: a small piece is handled more surely."""
    moving, resting = (sum(len(xy) for _, xy in parts) for parts in (body.moving, body.resting))
    return moving / max(moving + resting, 1)


def _crossings_between(topology: Topology, body: Body, angle: float) -> list[tuple[int, int]]:
    """``(moving, resting)`` sections of every crossing between the turned body and the rest."""
    moving, resting = segments(body.moving), segments(body.resting)
    starts, ends = turned(moving[0], body.center, angle), turned(moving[1], body.center, angle)
    i, j, xy = intersections((starts, ends), (resting[0], resting[1]))
    widths = np.array([s.width for s in topology.sections])
    apart = (
        np.hypot(*(xy - body.center).T) > 0.75 * widths[resting[2][j].astype(int)] + 4 if len(xy) else np.zeros(0, bool)
    )
    return [(int(moving[2][a]), int(resting[2][b])) for a, b, ok in zip(i, j, apart, strict=True) if ok]


def _clearance(topology: Topology, body: Body, angle: float, wished: float) -> tuple[float, float]:
    """Least distance between the outlines of the turned body and the rest, px, away from the place held; and the least
    share of what is wished (0 to 1): ``wished`` px and what an arm may err, nearer to the place held as far apart as an
    angle of 20 degrees."""
    widths = np.array([s.width for s in topology.sections])
    nothing = float(np.hypot(*topology.size))
    resting = [(k, xy) for k, xy in body.resting if len(xy)]
    if not resting:
        return nothing, 1.0
    rest_half = np.repeat([widths[k] / 2 for k, _ in resting], [len(xy) for _, xy in resting])
    tree = cKDTree(np.concatenate([xy for _, xy in resting]))
    least, share = nothing, 1.0
    for k, xy in body.moving:
        reach = np.hypot(*(xy - body.center).T)
        away, nearest = tree.query(turned(xy, body.center, angle))
        room = away - rest_half[nearest] - widths[k] / 2
        far, beside = reach > 4 * widths[k] + 8, reach > 1.5 * widths[k] + 4
        least = min(least, float(room[far].min(initial=nothing)))
        needed = np.clip(_SIDEWAYS * reach[beside], 1.0, wished + widths[k] + _TURN_ERROR * reach[beside])
        asked = np.minimum(away[beside] / needed, 1.0)
        share = min(share, float(asked.min(initial=1.0)))
    return least, share * float(np.clip(least / wished, 0.0, 1.0))


def _in_view(topology: Topology, body: Body, angle: float, params: DisentangleParams) -> float:
    """Share of the turned body that stays where the arms can put it."""
    xy = np.concatenate([turned(part, body.center, angle) for _, part in body.moving])
    height, across = topology.size
    low, high = -params.margin_px, np.array([across, height]) + params.margin_px
    return float(np.all((xy >= low) & (xy <= high), axis=1).mean())


def _certainty(topology: Topology, body: Body, pivot: Pivot) -> float:
    """Probability that the body lies on top at all crossings with what rests; a lower strand would be dragged."""
    certainty = 1.0
    for crossing in topology.crossings:
        over, under = (_moves(topology, p, body, pivot) for p in (crossing.over, crossing.under))
        if over != under:
            certainty *= crossing.order_score if over else 1 - crossing.order_score
    return certainty


def _passed(topology: Topology, body: Body, turn: float) -> tuple[int, ...]:
    """Sections that the body passes over on its way without lying on them before or after."""
    steps = np.linspace(0, turn, max(3, int(abs(np.rad2deg(turn)) // 10) + 2))
    on_the_way = {r for a in steps[1:-1] for _, r in _crossings_between(topology, body, float(a))}
    at_ends = {r for a in (0.0, turn) for _, r in _crossings_between(topology, body, a)}
    return tuple(sorted(on_the_way - at_ends))


def _grasps(
    topology: Topology, place: Place, pivot: Pivot, body: Body, turn: float
) -> tuple[tuple[Grasp, Grasp, Grasp, FloatArray], float]:
    """Hold at the pivot; pick beyond the crossing, before the section's end; place where the turn brings it. And how
    much of the room that both grippers need there is (0 to 1); at a branch-point strands are close anyhow."""
    section = topology.sections[place.section]
    lengths = arc_lengths(section.xy)
    if place.section == pivot.section:
        end = section.length if pivot.side > 0 else 0.0
    else:  # towards the end that is farther from the place held
        away = np.hypot(*(section.xy[[0, -1]] - body.center).T)
        end = section.length if away[1] > away[0] else 0.0
    picked, room = _free_place(topology, place.section, place.u * section.length, end)
    pick_xy = point_at(section.xy, lengths, np.array([picked]))[0]
    heading = _heading(section.xy, lengths, picked)
    held = topology.sections[pivot.section]
    hold_at = float(np.clip(pivot.at, 2.0, max(held.length - 2.0, 2.0)))
    if pivot.branch < 0:
        room = min(room, float(_room(topology, pivot.section, np.array([pivot.at]))[0]))
    path = np.stack([turned(pick_xy, body.center, float(a)) for a in np.linspace(0, turn, 25)])
    grasps = (
        Grasp(_pair(body.center), _heading(held.xy, arc_lengths(held.xy), hold_at)),
        Grasp(_pair(pick_xy), heading),
        Grasp(_pair(path[-1]), float(np.arctan2(np.sin(heading + turn), np.cos(heading + turn)))),
        path,
    )
    return grasps, room


def _free_place(topology: Topology, section: int, start: float, end: float) -> tuple[float, float]:
    """Arc length to grasp at, between the crossing and the section's end, with room for a hand; and how much (0 to
    1)."""
    places = start + np.linspace(0.25, 0.95, 15) * (end - start)
    room = _room(topology, section, places)
    best = int(np.argmax(room - 1e-3 * np.abs(places - places[5]) / max(abs(end - start), 1e-9)))
    return float(places[best]), float(room[best])


def _room(topology: Topology, section: int, places: FloatArray) -> FloatArray:
    """``(n,)`` shares of what a hand needs between the section at these arc lengths and all other strands, its own
    other passes included."""
    own = topology.sections[section]
    lengths = arc_lengths(own.xy)
    xy = point_at(own.xy, lengths, places)
    needed = own.width / 2 + _HAND_PX
    away = np.full(len(places), np.inf)
    for k, other in enumerate(topology.sections):
        apart = np.hypot(*np.moveaxis(xy[:, None] - other.xy[None], -1, 0)) - other.width / 2
        if k == section:
            apart[np.abs(lengths[None] - places[:, None]) < 3 * own.width + _HAND_PX] = np.inf
        away = np.minimum(away, apart.min(axis=1))
    out: FloatArray = np.clip(away / needed, 0.0, 1.0)
    return out


def _heading(xy: FloatArray, lengths: FloatArray, at: float) -> float:
    before, after = point_at(xy, lengths, np.clip(np.array([at - 4, at + 4]), 0, lengths[-1]))
    return float(np.arctan2(after[1] - before[1], after[0] - before[0]))


def _pair(xy: FloatArray) -> tuple[float, float]:
    x, y = xy.tolist()
    return x, y


@dataclass(frozen=True)
class Base:
    """An arm's base in the picture's plane, px (it may lie outside), and how far it reaches."""

    xy: tuple[float, float]
    reach: float = np.inf


def assign_arms(action: Action, bases: Sequence[Base]) -> tuple[int, int] | None:
    """Indices of the holding and the moving arm: the pair with the least distance to what each has to reach (6.7);
    None if neither way is within reach."""
    best: tuple[float, tuple[int, int]] | None = None
    for hold in range(len(bases)):
        for move in range(len(bases)):
            if hold == move:
                continue
            near = float(np.hypot(*np.subtract(bases[hold].xy, action.hold.xy)))
            far = float(np.hypot(*(action.trajectory - np.array(bases[move].xy)).T).max())
            if near <= bases[hold].reach and far <= bases[move].reach and (best is None or near + far < best[0]):
                best = (near + far, (hold, move))
    return None if best is None else best[1]
