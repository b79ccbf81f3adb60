"""The evidence of whether a turn will work, for a small network to weigh. Lengths are in hands
where nothing else is written; what is far away counts as a bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.disentangling.hold_candidates import Held
from models.geometry.polylines import arc_lengths, point_at
from models.topology.scene import Topology

_FAR, _FARTHEST = 12.0, 40.0
"""Hands; what is farther is as far (within a piece, and within the picture)."""
_ALIKE = 0.3
"""Sections whose widths differ by a larger log ratio are not the same one."""


class HeldEvidence(NamedTuple):
    """What does not depend on the angle: how sure the order, the crossings and the branch-points
    are; what is held and how; how much moves and how far it reaches; what is out of sight."""

    certainty: float
    parted_score: float
    least_crossing_score: float
    branch_score: float
    least_branch_score: float
    held_at_branch: float
    pick_room: float
    hold_room: float
    leaves_view: float
    others_at_border: float
    moving_share: float
    reach: float
    next_branch: float
    pick_distance: float
    crossing_distance: float
    moving_sections: float
    width: float
    sections: float
    alike_entering: float
    nearest_entering: float


class CountEvidence(NamedTuple):
    """Crossings there are, that go, that are left; how many more may be left one and two steps of
    the angle beside; how often no more are left though arms err."""

    crossings: float
    removed: float
    left: float
    more_one_step: float
    more_two_steps: float
    chance: float


class RoomEvidence(NamedTuple):
    """Least distance to the rest in widths; share of the room that is wished; least distance over
    that to the place held; least distance from an end to the rest in widths; share in the picture;
    distance to its border in widths; the turn as a share of half a turn."""

    clearance: float
    room_share: float
    sideways: float
    ends: float
    in_picture: float
    border: float
    turn: float


class SetBackEvidence(NamedTuple):
    """How many more crossings are left if the branch-point is a little, or much, nearer to the
    bundle than it seems."""

    more_little: float
    more_much: float


MOVE_FEATURES = (
    *HeldEvidence._fields,
    *CountEvidence._fields,
    *RoomEvidence._fields,
    *SetBackEvidence._fields,
)
"""Names of the columns that the network of moves weighs."""


def held_evidence(topology: Topology, held: Held) -> HeldEvidence:
    pivot, body = held.pivot, held.body
    moving, resting = (sum(len(xy) for _, xy in parts) for parts in (body.moving, body.resting))
    own = {n for n, _ in body.moving}
    others = [b.xy for k, b in enumerate(topology.branch_points) if k != pivot.branch]
    nearest = min((_away(held, xy) for xy in others), default=np.inf)
    section = topology.sections[pivot.section]
    picked = topology.sections[held.pick[0]]
    pick = point_at(picked.xy, arc_lengths(picked.xy), np.array([held.pick[1]]))[0]
    alike, entering = _entering(topology, own)
    return HeldEvidence(
        certainty=held.certainty,
        parted_score=min(topology.crossings[k].score for k, _ in held.parted),
        least_crossing_score=min(c.score for c in topology.crossings),
        branch_score=topology.branch_points[pivot.branch].score if pivot.branch >= 0 else 1.0,
        least_branch_score=min((b.score for b in topology.branch_points), default=1.0),
        held_at_branch=float(pivot.branch >= 0),
        pick_room=held.room[0],
        hold_room=held.room[1],
        leaves_view=float(body.leaves_view),
        others_at_border=float(
            sum("border" in s.ends for n, s in enumerate(topology.sections) if n not in own)
        ),
        moving_share=moving / max(moving + resting, 1),
        reach=min(
            max(float(np.hypot(*(xy - body.center).T).max()) for _, xy in body.moving if len(xy)),
            _FARTHEST,
        ),
        next_branch=min(nearest / max(2.5 * section.width, 1.0), 6.0),
        pick_distance=min(_away(held, pick), _FAR),
        crossing_distance=min(_away(held, topology.crossings[held.parted[0][0]].xy), _FAR),
        moving_sections=float(len(body.moving)),
        width=section.width,
        sections=float(len(topology.sections)),
        alike_entering=float(alike),
        nearest_entering=entering,
    )


def _away(held: Held, xy: object) -> float:
    """From the place held."""
    return float(np.hypot(*(np.asarray(xy) - held.body.center)))


def _entering(topology: Topology, moving: set[int]) -> tuple[int, float]:
    """Whether the piece may come back into the picture: sections that enter it, reach no
    branch-point, and are as wide as one of the piece that leaves it; and from where that leaves to
    the nearest that enters, at most 40 hands."""
    leaving = [
        (s.xy[end], s.width)
        for k in moving
        for s in (topology.sections[k],)
        for end in (0, -1)
        if s.ends[end] == "border"
    ]
    entering = [
        (s.xy[end], s.width)
        for k, s in enumerate(topology.sections)
        for end in (0, -1)
        if k not in moving and s.ends[end] == "border" and max(s.branches) < 0
    ]
    alike = [
        float(np.hypot(*(a - b)))
        for a, wide in leaving
        for b, other in entering
        if abs(np.log(wide / other)) < _ALIKE
    ]
    return len(alike), min([*alike, _FARTHEST])
