"""From matched section ends to one centerline a DLO."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.directions import unit
from models.geometry.polylines import arc_lengths, bridge
from models.strands.chain import Chain
from models.strands.pixel_graph import FREE
from models.strands.sections import Sections

_TIP_RADII = 1.5
"""At a free end so much of a skeleton may turn to a corner of the tip."""


@dataclass(frozen=True)
class Joint:
    """How two ends are joined.

    ``via``: the section that their DLO shares with another, -1 for none. ``doubt``: minus the log
    probability that they belong together.
    """

    via: int
    doubt: float


Joints = Mapping[tuple[int, int], Joint]
"""By the two ends, the lower first."""
_PLAIN = Joint(via=-1, doubt=0.0)


def follow(partner: IntArray, done: BoolArray | None = None) -> list[tuple[list[int], bool]]:
    """Sections strung together: the ends at which each is entered, in order, and whether that is a
    ring.

    ``partner``: ``(E,)`` of ends ``2 s`` and ``2 s + 1`` of section ``s``, itself for an end that
    stops. ``done``: ``(S,)`` sections to leave out. Strings with free ends come first; a ring is
    opened at its first section.
    """
    left = np.zeros(len(partner) // 2, dtype=bool) if done is None else done.copy()
    found = []
    stops = np.flatnonzero(partner == np.arange(len(partner)))
    for start in [*stops.tolist(), *range(0, len(partner), 2)]:
        entered: list[int] = []
        end = start
        while not left[end >> 1]:
            left[end >> 1] = True
            entered.append(end)
            end = int(partner[end ^ 1]) if partner[end ^ 1] != end ^ 1 else end
        if entered:
            found.append((entered, bool(end == start and partner[start] != start)))
    return found


def strands_of(sections: Sections, partner: IntArray, joints: Joints) -> list[Chain]:
    """The centerlines that follow from the partners ``(E,)`` of all ends; an end that stops is its
    own partner.

    A section that a joint shares is followed at the offset that the DLO has on both sides. A
    section whose two ends are joined as shared is no strand of its own.
    """
    done = sections.closed.copy()
    done[[k for k in range(len(sections)) if joints.get((2 * k, 2 * k + 1), _PLAIN).via == k]] = (
        True
    )
    rings = [Chain(sections.points(k), True) for k in np.flatnonzero(sections.closed).tolist()]
    return rings + [
        _chain(sections, entered, ring, joints) for entered, ring in follow(partner, done)
    ]


def _chain(sections: Sections, entered: list[int], ring: bool, joints: Joints) -> Chain:
    """The strand through sections that are entered at these ends."""
    pieces, doubt = [], 0.0
    for place, end in enumerate(entered):
        points = sections.points(end >> 1)
        pieces.append(points if end % 2 == 0 else points[::-1])
        if place + 1 < len(entered) or ring:
            onward = entered[(place + 1) % len(entered)]
            joint = joints.get((min(end ^ 1, onward), max(end ^ 1, onward)), _PLAIN)
            pieces.append(_connection(sections, end ^ 1, onward, joint.via))
            doubt += joint.doubt
    points = np.concatenate(pieces)
    return Chain(
        points if ring else _between_tips(points, sections, entered[0], entered[-1] ^ 1),
        ring,
        doubt,
    )


def _between_tips(points: FloatArray, sections: Sections, first: int, last: int) -> FloatArray:
    """The points without the free ends in view, where a skeleton turns to a corner: the assembly
    goes on straight."""
    loose = [sections.node[e] == FREE and not sections.at_border[e] for e in (first, last)]
    cut = [
        round(_TIP_RADII * sections.end_radius[e]) if free else 0
        for e, free in zip((first, last), loose, strict=True)
    ]
    cut = [min(c, len(points) // 4) for c in cut]
    return points[cut[0] : len(points) - cut[1]]


def _connection(sections: Sections, a: int, b: int, shared: int) -> FloatArray:
    """Points between two linked ends, both left out."""
    if shared >= 0:
        return _beside(sections, a, b, shared)
    start, stop = sections.tip[a], sections.tip[b]
    length = float(np.hypot(*(stop - start)))
    shares = np.linspace(0, 1, max(2, round(length) + 1))[1:-1]
    curve = bridge(start[None], stop[None], sections.outward[[a]], -sections.outward[[b]], shares)
    out: FloatArray = curve[0]
    return out


def _beside(sections: Sections, a: int, b: int, shared: int) -> FloatArray:
    """Along the shared section, moved by what the strand is beside it at both ends, from one to the
    other.

    Only the part of the offset across the section counts; it changes evenly along the way.
    """
    points = sections.points(shared)
    if sections.node[2 * shared] != sections.node[a]:
        points = points[::-1]
    along = arc_lengths(points)
    share = (along / along[-1])[:, None]
    first = _across(sections.tip[a] - points[0], points[min(4, len(points) - 1)] - points[0])
    last = _across(sections.tip[b] - points[-1], points[-1] - points[max(len(points) - 5, 0)])
    limit = 0.5 * sections.radius[shared]
    first, last = (unit(v) * min(limit, float(np.hypot(*v))) for v in (first, last))
    out: FloatArray = points + (1 - share) * first + share * last
    return out[2:-2:2]


def _across(vector: FloatArray, direction: FloatArray) -> FloatArray:
    along = unit(direction)
    out: FloatArray = vector - float(vector @ along) * along
    return out
