"""Places of a harness to hold, and the piece that each lets turn (thesis 6.7).

The thesis holds the branch-point that the upper section hangs on. Here every branch-point and a few
places along the sections that cross are looked at, for the piece on either side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.disentangling.hands import allowance
from models.disentangling.rigid_piece import Body, Pivot, body_of
from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.topology.scene import Place, Topology

_MOST_CROSSINGS = 24
"""Crossings that are looked at: more take too long, and those nearest to a free end come first
anyway."""
_LONG = 6.0
"""Hands; longer stretches are held at several places."""
_HOLD_SHARES = (0.15, 0.4, 0.6, 0.85)
"""The several places, as shares of a stretch."""
_PICK_SHARES = np.linspace(0.25, 0.95, 15)
_USUAL_PICK = 5
"""Places to pick, as shares of what is beyond the crossing, and the one that is taken where room
does not decide."""
_ENOUGH_ROOM = 0.8
"""With so much of the room that a hand needs beyond the crossing, other places need not be looked
at."""
_OFF_BRANCH = (2.5, 0.75)
"""Widths and hands from a branch-point within which a gripper takes the bundle, not the strand."""
_LEAST_CERTAINTY = 0.1
"""A piece that is more probably under something is left alone: it would drag that along."""


Pick = tuple[int, float]
"""A section and an arc length on it."""


@dataclass(frozen=True, eq=False)
class Held:
    """A place that is held and what it lets turn. ``parted``: the crossings of which one pass moves
    and the other rests, with the one that moves; ``certainty``: probability that the piece is on
    top at all of them; ``pick``: where the piece is grasped; ``room``: shares of what the hands
    need there and at the pivot."""

    pivot: Pivot
    body: Body
    parted: tuple[tuple[int, Place], ...]
    certainty: float
    pick: Pick
    room: tuple[float, float]


MOST_HOLDS = 120
"""Places to hold that are looked at: more take longer and were never the best."""


def find_holds(topology: Topology, most: int = MOST_HOLDS) -> list[Held]:
    """Places from which something that crosses can be turned.

    At most 24 crossings, those nearest to a free end first as they are easiest to undo (6.7), and
    ``most`` places are looked at.
    """
    order = sorted(range(len(topology.crossings)), key=lambda k: _depth(topology, k))[
        :_MOST_CROSSINGS
    ]
    found = (_held(topology, order, pivot) for pivot in _pivots(topology, order)[:most])
    return [held for held in found if held is not None]


def _depth(topology: Topology, k: int) -> float:
    """Length from a crossing to the nearest free end along its sections; large where there is
    none."""
    crossing = topology.crossings[k]
    found = [np.inf]
    for place in (crossing.over, crossing.under):
        section = topology.sections[place.section]
        for end, share in ((0, place.u), (1, 1 - place.u)):
            if section.branches[end] < 0 and not section.closed:
                found.append(share * section.length)
    return min(found)


def _pivots(topology: Topology, order: Sequence[int]) -> list[Pivot]:
    """Where to hold: the branch-points of the sections that cross, places along these, then all
    branch-points."""
    crossed = [
        p.section for k in order for p in (topology.crossings[k].over, topology.crossings[k].under)
    ]
    pivots = [
        p
        for k in dict.fromkeys(crossed)
        for p in _branch_pivots(topology, k) + _inner_pivots(topology, k)
    ]
    pivots += [p for k in range(len(topology.sections)) for p in _branch_pivots(topology, k)]
    return list(dict.fromkeys(pivots))


def _branch_pivots(topology: Topology, k: int) -> list[Pivot]:
    section = topology.sections[k]
    ends = ((0.0, 1, section.branches[0]), (section.length, -1, section.branches[1]))
    return [Pivot(k, at, side, branch) for at, side, branch in ends if branch >= 0]


def _inner_pivots(topology: Topology, k: int) -> list[Pivot]:
    """Places along a section for the piece on either side: between every two crossings on it, and
    beyond them; not so near to a branch-point that this would be held."""
    section = topology.sections[k]
    if section.closed:
        return []
    passes = [
        (a, b)
        for c in topology.crossings
        for a, b in ((c.over, c.under), (c.under, c.over))
        if a.section == k
    ]
    stops = sorted((a.u * section.length, _gap(topology, a, b)) for a, b in passes)
    pivots = []
    near = float(allowance(section.width, *_OFF_BRANCH))
    first, last = (near if branch >= 0 else 0.0 for branch in section.branches)
    for (start, before), (end, after) in pairwise([(0.0, first), *stops, (section.length, last)]):
        free = end - start - before - after
        if free <= 0:
            continue
        for share in _HOLD_SHARES if free > _LONG else (0.5,):
            at = start + before + share * free
            pivots += [Pivot(k, at, side, -1) for side in (1, -1)]
    return pivots


def _gap(topology: Topology, place: Place, other: Place) -> float:
    """How far from a crossing a hand may hold."""
    wider = max(topology.sections[place.section].width, topology.sections[other.section].width)
    return float(allowance(wider, 1.5, 0.5))


def _held(topology: Topology, order: Sequence[int], pivot: Pivot) -> Held | None:
    """None where the piece is held elsewhere too, or by what is on it."""
    body = body_of(topology, pivot)
    if body is None:
        return None
    parted = parted_by(topology, order, body, pivot)
    certainty = _certainty(topology, body, pivot)
    if not parted or certainty < _LEAST_CERTAINTY:
        return None
    pick, room = _free_place(topology, body, pivot, parted[0][1])
    hold_room = (
        1.0
        if pivot.branch >= 0
        else float(room_at(topology, pivot.section, np.array([pivot.at]))[0])
    )
    return Held(pivot, body, tuple(parted), certainty, pick, (room, hold_room))


def parted_by(
    topology: Topology, order: Sequence[int], body: Body, pivot: Pivot
) -> list[tuple[int, Place]]:
    """Of some crossings those of which one pass moves and the other rests, with the one that
    moves."""
    found = []
    for k in order:
        passes = (topology.crossings[k].over, topology.crossings[k].under)
        moving = [p for p in passes if moves_with(topology, p, body, pivot)]
        if len(moving) == 1:
            found.append((k, moving[0]))
    return found


def moves_with(topology: Topology, place: Place, body: Body, pivot: Pivot) -> bool:
    """Whether a place of a section belongs to the piece that moves."""
    if place.section == pivot.section:
        return (place.u * topology.sections[place.section].length - pivot.at) * pivot.side > 0
    return any(k == place.section for k, _ in body.moving)


def _certainty(topology: Topology, body: Body, pivot: Pivot) -> float:
    """Probability that the body is on top at all crossings with what rests; a lower strand would be
    dragged."""
    certainty = 1.0
    for crossing in topology.crossings:
        over, under = (
            moves_with(topology, p, body, pivot) for p in (crossing.over, crossing.under)
        )
        if over != under:
            certainty *= crossing.order_score if over else 1 - crossing.order_score
    return certainty


def _free_place(topology: Topology, body: Body, pivot: Pivot, crossed: Place) -> tuple[Pick, float]:
    """Where to grasp the piece, and how much of the room for a hand there is (0 to 1): beyond the
    crossing before the section's end, or where that is too narrow, anywhere on the piece."""
    section = topology.sections[crossed.section]
    if crossed.section == pivot.section:
        end = section.length if pivot.side > 0 else 0.0
    else:  # towards the end that is farther from the place held
        away = np.hypot(*(section.xy[[0, -1]] - body.center).T)
        end = section.length if away[1] > away[0] else 0.0
    start = crossed.u * section.length
    found = [_roomiest(topology, crossed.section, start, end)]
    if found[0][1] < _ENOUGH_ROOM:
        for k, _ in body.moving:
            whole = topology.sections[k].length
            own = (
                (pivot.at, whole if pivot.side > 0 else 0.0) if k == pivot.section else (0.0, whole)
            )
            found.append(_roomiest(topology, k, *own))
    return max(found, key=lambda f: f[1])


def _roomiest(topology: Topology, section: int, start: float, end: float) -> tuple[Pick, float]:
    places = start + _PICK_SHARES * (end - start)
    room = room_at(topology, section, places)
    best = int(
        np.argmax(room - 1e-3 * np.abs(places - places[_USUAL_PICK]) / max(abs(end - start), 1e-9))
    )
    return (section, float(places[best])), float(room[best])


def room_at(topology: Topology, section: int, places: FloatArray) -> FloatArray:
    """``(n,)`` shares of what a hand needs between the section at these arc lengths and all other
    strands, its own other passes included."""
    own = topology.sections[section]
    lengths = arc_lengths(own.xy)
    xy = point_at(own.xy, lengths, places)
    needed = allowance(own.width, 0.5, 1.0)
    away = np.full(len(places), np.inf)
    for k, other in enumerate(topology.sections):
        apart = np.hypot(*np.moveaxis(xy[:, None] - other.xy[None], -1, 0)) - other.width / 2
        if k == section:
            apart[np.abs(lengths[None] - places[:, None]) < allowance(own.width, 3.0, 1.0)] = np.inf
        away = np.minimum(away, apart.min(axis=1))
    return np.clip(away / needed, 0.0, 1.0)
