"""From matched section ends to one centerline a DLO."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.polylines import arc_lengths, bridge
from models.strands.chain import Chain
from models.strands.pixel_graph import FREE
from models.strands.sections import Sections

_SPACING_PX = 3.0
_TIP_RADII = 1.5


@dataclass(frozen=True)
class Joint:
    """How two ends are joined.

    ``via``: the section that their DLO shares with another, -1 for none. ``doubt``: minus the log probability that
    they belong together.
    """

    via: int = -1
    doubt: float = 0.0


Joints = Mapping[tuple[int, int], Joint]
"""By the two ends, the lower first."""
_PLAIN = Joint()


def strands_of(sections: Sections, partner: IntArray, joints: Joints) -> list[Chain]:
    """The centerlines that follow from the partners ``(E,)`` of all ends; an end that stops is its own partner.

    A section that a joint shares is followed at the offset that the DLO has on both sides. A section whose two ends
    are joined as shared is no strand of its own.
    """
    done = sections.closed.copy()
    shared = [k for k in range(len(sections)) if joints.get((2 * k, 2 * k + 1), _PLAIN).via == k]
    done[shared] = True
    chains = [Chain(sections.points(k), True) for k in np.flatnonzero(sections.closed).tolist()]
    stops = np.flatnonzero(partner == np.arange(len(partner)))
    for start in [*stops.tolist(), *range(0, 2 * len(sections), 2)]:
        chains += [] if done[start >> 1] else [_walk(sections, partner, joints, start, done)]
    return chains


def _walk(sections: Sections, partner: IntArray, joints: Joints, start: int, done: BoolArray) -> Chain:
    """The strand that begins at this end; a ring ends where it begins."""
    pieces, end, doubt = [], start, 0.0
    while True:
        done[end >> 1] = True
        points = sections.points(end >> 1)
        pieces.append(points if end % 2 == 0 else points[::-1])
        leaving = end ^ 1
        onward = int(partner[leaving])
        closed = onward == start
        if onward == leaving or (done[onward >> 1] and not closed):
            return Chain(_between_tips(np.concatenate(pieces), sections, start, leaving), False, doubt)
        joint = joints.get((min(leaving, onward), max(leaving, onward)), _PLAIN)
        pieces.append(_connection(sections, leaving, onward, joint.via))
        doubt += joint.doubt
        if closed:
            return Chain(np.concatenate(pieces), True, doubt)
        end = onward


def _between_tips(points: FloatArray, sections: Sections, first: int, last: int) -> FloatArray:
    """The points without the free ends in view, where a skeleton turns to a corner: the assembly goes on straight."""
    loose = [sections.node[e] == FREE and not sections.at_border[e] for e in (first, last)]
    cut = [
        round(_TIP_RADII * sections.end_radius[e]) if free else 0 for e, free in zip((first, last), loose, strict=True)
    ]
    cut = [min(c, len(points) // 4) for c in cut]
    return points[cut[0] : len(points) - cut[1]]


def _connection(sections: Sections, a: int, b: int, shared: int) -> FloatArray:
    """Points between two linked ends, both left out."""
    if shared >= 0:
        return _beside(sections, a, b, shared)
    start, stop = sections.tip[a], sections.tip[b]
    length = float(np.hypot(*(stop - start)))
    shares = np.linspace(0, 1, max(2, round(length / _SPACING_PX) + 1))[1:-1]
    curve = bridge(start[None], stop[None], sections.outward[[a]], -sections.outward[[b]], shares)
    out: FloatArray = curve[0]
    return out


def _beside(sections: Sections, a: int, b: int, shared: int) -> FloatArray:
    """Along the shared section, moved by what the strand is beside it at both ends, from one to the other.

    Only the part of the offset across the section counts; it changes evenly along the way.
    """
    points = sections.points(shared)
    if sections.node[2 * shared] != sections.node[a]:
        points = points[::-1]
    along = arc_lengths(points)
    share = (along / max(float(along[-1]), 1e-9))[:, None]
    first = _across(sections.tip[a] - points[0], points[min(4, len(points) - 1)] - points[0])
    last = _across(sections.tip[b] - points[-1], points[-1] - points[max(len(points) - 5, 0)])
    limit = 0.5 * sections.radius[shared]
    first, last = (v * min(1.0, limit / max(float(np.hypot(*v)), 1e-9)) for v in (first, last))
    out: FloatArray = points + (1 - share) * first + share * last
    return out[2:-2:2]


def _across(vector: FloatArray, direction: FloatArray) -> FloatArray:
    unit = direction / max(float(np.hypot(*direction)), 1e-9)
    out: FloatArray = vector - float(vector @ unit) * unit
    return out
