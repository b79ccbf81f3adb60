"""What moves when a section is turned about a place that is held: the piece beyond it, rigid
(thesis 6.7)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.disentangling.hands import allowance
from models.geometry.arrays import FloatArray
from models.geometry.directions import unit
from models.geometry.polylines import arc_lengths, point_at
from models.topology.scene import Topology

_STEP = 2 / 3
"""Hands between the points of a piece that is swept: finer than any strand that a hand can take
bends."""
_MOST_POINTS = 150
"""Of one section, so that a long thin one takes no longer than its bends need."""
_HEADING_WIDTHS = 4.0
"""A section's direction at its end is read off so many widths: beyond the blob where strands
meet."""
_BLOB = 1 / 6
"""Hands by which the blob where strands meet reaches beyond half a width."""


@dataclass(frozen=True)
class Pivot:
    """A place that is held: on ``section`` at arc length ``at``; the piece towards ``side`` (+1:
    the section's last point, -1: its first) turns about it. ``branch``: the branch-point there, or
    -1."""

    section: int
    at: float
    side: int
    branch: int


@dataclass(frozen=True, eq=False)
class Body:
    """``moving`` and ``resting``: polylines ``(n, 2)`` with the index of their section; ``center``
    (2,)."""

    center: FloatArray
    moving: tuple[tuple[int, FloatArray], ...]
    resting: tuple[tuple[int, FloatArray], ...]
    leaves_view: bool


def body_of(topology: Topology, pivot: Pivot) -> Body | None:
    """The body beyond a pivot, or None where it is also held elsewhere (it is part of a closed
    cycle) or has no length."""
    section = topology.sections[pivot.section]
    lengths = arc_lengths(section.xy)
    far = section.branches[1 if pivot.side > 0 else 0]
    near = section.branches[0 if pivot.side > 0 else 1]
    downstream = _beyond(topology, pivot.section, far)
    if downstream is None or (pivot.branch >= 0 and _touches(topology, downstream, near)):
        return None
    if far >= 0 and near >= 0 and far == near:
        return None
    first, second = _cut(section.xy, lengths, pivot.at)
    moved, kept = (second, first) if pivot.side > 0 else (first, second)
    moving = [(pivot.section, moved)] + [(k, _coarse(topology.sections[k].xy)) for k in downstream]
    resting = [(pivot.section, kept)] if len(kept) > 1 else []
    others = set(range(len(topology.sections))) - set(downstream) - {pivot.section}
    resting += [(k, _coarse(topology.sections[k].xy)) for k in sorted(others)]
    ends = [topology.sections[pivot.section].ends[1 if pivot.side > 0 else 0]]
    ends += [e for k in downstream for e in topology.sections[k].ends]
    center = point_at(section.xy, lengths, np.array([pivot.at]))[0]
    if not any(len(xy) for _, xy in moving):
        return None
    return Body(center, tuple(moving), tuple(resting), "border" in ends)


def set_back(topology: Topology, pivot: Pivot, body: Body, away: float) -> Body | None:
    """The body if the branch-point that is held is ``away`` hands nearer to the bundle than it
    seems: strands that leave a bundle side by side show as two only where they part. None where
    three strands do not meet."""
    arms = arms_at(topology, pivot.branch)
    if len(arms) != 3:
        return None
    ways = np.array([heading_from(topology, k, end, away) for k, end in arms])
    likeness = ways @ ways.T - 2 * np.eye(3)
    bundle, end = arms[int(likeness.max(axis=1).argmin())]
    section = topology.sections[bundle]
    lengths = arc_lengths(section.xy)
    reach = min(away, section.length / 2)
    first = section.length - reach if end else 0.0
    lead = _piece(section.xy, lengths, first, first + reach)
    center = lead[0] if end else lead[-1]
    if bundle != pivot.section:
        return replace(body, center=center, moving=(*body.moving, (pivot.section, lead)))
    left = (0.0, section.length - reach) if end else (reach, section.length)
    rest = next(k for k, _ in arms if k != bundle)
    moving = ((bundle, _piece(section.xy, lengths, *left)), *body.moving[1:])
    return replace(body, center=center, moving=moving, resting=(*body.resting, (rest, lead)))


def arms_at(topology: Topology, branch: int) -> list[tuple[int, int]]:
    """``(section, end)`` of every section end at a branch-point."""
    meeting = sorted(set(topology.branch_points[branch].sections))
    return [
        (k, end) for k in meeting for end in (0, 1) if topology.sections[k].branches[end] == branch
    ]


def heading_from(topology: Topology, section: int, end: int, away: float) -> FloatArray:
    """``(2,)`` the direction in which a section leaves one of its ends, over a few widths, at least
    ``away``."""
    whole = topology.sections[section]
    xy = whole.xy if end == 0 else whole.xy[::-1]
    lengths = arc_lengths(xy)
    reach = max(_HEADING_WIDTHS * whole.width, away) + _BLOB
    near, far = point_at(
        xy, lengths, np.minimum([float(allowance(whole.width, 0.5, _BLOB)), reach], lengths[-1])
    )
    return unit(far - near)


def _beyond(topology: Topology, section: int, branch: int) -> list[int] | None:
    """The sections that hang on a branch-point, without going back over ``section``; None if one
    leads back to it."""
    if branch < 0:
        return []
    found: list[int] = []
    waiting, seen = [branch], {branch}
    while waiting:
        here = waiting.pop()
        for k in topology.branch_points[here].sections:
            if k == section or k in found:
                continue
            found.append(k)
            for end in topology.sections[k].branches:
                if end >= 0 and end not in seen:
                    seen.add(end)
                    waiting.append(end)
    back = set(topology.sections[section].branches) - {branch, -1}
    return None if back & seen else found


def _touches(topology: Topology, sections: list[int], branch: int) -> bool:
    return branch >= 0 and any(branch in topology.sections[k].branches for k in sections)


def _cut(xy: FloatArray, lengths: FloatArray, at: float) -> tuple[FloatArray, FloatArray]:
    """The polyline before and after an arc length, coarse; one of them is empty at its ends."""
    total = float(lengths[-1])
    return _piece(xy, lengths, 0.0, at), _piece(xy, lengths, at, total)


def _piece(xy: FloatArray, lengths: FloatArray, start: float, stop: float) -> FloatArray:
    if stop - start < 1e-6:
        return np.zeros((0, 2))
    count = min(max(2, round((stop - start) / _STEP) + 1), _MOST_POINTS)
    return point_at(xy, lengths, np.linspace(start, stop, count))


def _coarse(xy: FloatArray) -> FloatArray:
    lengths = arc_lengths(xy)
    return _piece(xy, lengths, 0.0, float(lengths[-1]))


def as_pair(xy: FloatArray) -> tuple[float, float]:
    """A point ``(2,)`` as a topology holds it."""
    x, y = xy.tolist()
    return x, y


def turned(xy: FloatArray, center: FloatArray, angle: float) -> FloatArray:
    """``(…, 2)`` points turned about ``center`` by ``angle`` radians, from x towards y."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return center + (xy - center) @ np.array([[cosine, sine], [-sine, cosine]])
