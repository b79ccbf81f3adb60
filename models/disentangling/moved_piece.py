"""Where a piece that was turned lies in the next picture: near where it should, and rigid.

Strategy: of angles about the one that was meant the one that explains most of what is seen; then
the rigid movement that brings the piece onto what is seen near it, in rounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from models.disentangling.rigid_piece import Body, Pivot, as_pair, turned
from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.polylines import arc_lengths, resample
from models.topology.scene import Section, Topology

STEP = 0.25
"""Hands between the points of lines that are compared."""
NEAR = 0.7
"""Hands between lines that are the same: a strand's width."""
_ERRORS = np.deg2rad(np.arange(-12.0, 12.1, 1.5))
"""By how much arms may have turned the piece too far: four standard deviations of the simulated
world's."""
_FAR, _REACH = 3.0, 2.0
"""Hands: what is farther counts no more, and moves the piece no more."""
_ROUNDS, _FEWEST = 8, 8
"""Rounds of the movement, and points that it needs."""
_MOST_OFF = 1.5
"""Hands by which the place held may have been elsewhere: a branch-point is read where strands are
seen to part."""
_LEAST_TURN = 0.2
"""Radians; of a smaller turn nobody can tell about which place it was."""
_JOINT = 1.0
"""Hands from a branch-point within which its sections are drawn straight, beyond the shift of what
moved."""


@dataclass(frozen=True)
class View:
    """The picture, in hands."""

    width: float
    height: float

    def shows(self, xy: FloatArray, margin: float = 0.0) -> BoolArray:
        """``(...,)`` whether points ``(..., 2)`` lie so far inside."""
        high = np.array([self.width, self.height]) - margin
        return np.asarray(((xy >= margin) & (xy < high)).all(axis=-1))


@dataclass(frozen=True, eq=False)
class Movement:
    """A turn by ``angle`` radians about ``center`` (2,) and a ``shift`` (2,)."""

    center: FloatArray
    angle: float
    shift: FloatArray

    def __call__(self, xy: FloatArray) -> FloatArray:
        return turned(xy, self.center, self.angle) + self.shift

    @property
    def fixed(self) -> FloatArray:
        """``(2,)`` the place that did not move; the center where the turn is small."""
        if abs(np.sin(self.angle / 2)) < np.sin(_LEAST_TURN / 2):
            return self.center
        left = np.eye(2) - turned(np.eye(2), np.zeros(2), self.angle).T
        return np.asarray(self.center + np.linalg.solve(left, self.shift))


def dense(xy: FloatArray) -> FloatArray:
    """A polyline with a point every quarter of a hand."""
    return resample(xy, max(2, int(arc_lengths(xy)[-1] / STEP) + 1)) if len(xy) > 1 else xy


def points_of(lines: Sequence[FloatArray]) -> FloatArray:
    return np.concatenate([np.zeros((0, 2)), *(dense(xy) for xy in lines if len(xy))])


def movement_of(body: Body, turn: float, shown: Topology, view: View) -> Movement | None:
    """How a body moved that was to turn by ``turn`` radians, by the picture after it; None where
    that is no turn about the place held."""
    piece, rest = (points_of([xy for _, xy in parts]) for parts in (body.moving, body.resting))
    seen = points_of([s.xy for s in shown.sections])
    if not len(seen):
        return Movement(body.center, turn, np.zeros(2))
    free = seen[cKDTree(rest).query(seen)[0] > NEAR] if len(rest) else seen
    everything = cKDTree(seen)

    def left_over(move: Movement) -> float:
        there = move(piece)
        visible = there[view.shows(there)]
        missing = np.minimum(everything.query(visible)[0], _FAR).sum() if len(visible) else 0.0
        return float(missing + np.minimum(cKDTree(there).query(free)[0], _FAR).sum())

    meant = (Movement(body.center, turn + e, np.zeros(2)) for e in _ERRORS.tolist())
    best = min(meant, key=left_over)
    for _ in range(_ROUNDS):
        away, nearest = cKDTree(best(piece)).query(free)
        close = away < _REACH
        if close.sum() < _FEWEST:
            break
        best = _onto(best, piece[nearest[close]], free[close])
    return best if np.hypot(*(best.fixed - best.center)) < _MOST_OFF else None


def _onto(move: Movement, piece: FloatArray, there: FloatArray) -> Movement:
    """The movement that brings points ``(n, 2)`` onto others with the least squares."""
    a, b = piece.mean(axis=0), there.mean(axis=0)
    p, q = piece - a, there - b
    angle = float(np.arctan2((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum(), (p * q).sum()))
    return Movement(move.center, angle, b - turned(a, move.center, angle))


def joined(topology: Topology, pivot: Pivot, move: Movement) -> Topology:
    """The topology with the sections that meet at the branch-point that was held led to where it
    proved to be; without crossings of these there, which come from where it was read."""
    reach = _JOINT + float(np.hypot(*move.shift))
    sections, points = list(topology.sections), list(topology.branch_points)
    meeting = {pivot.section}
    if pivot.branch >= 0:
        meeting |= set(points[pivot.branch].sections)
        points[pivot.branch] = replace(points[pivot.branch], xy=as_pair(move.fixed))
        for k in meeting:
            for end in (0, 1):
                if sections[k].branches[end] == pivot.branch:
                    sections[k] = _led_to(sections[k], end, move.fixed, reach)
    crossings = tuple(
        c
        for c in topology.crossings
        if not {c.over.section, c.under.section} <= meeting
        or np.hypot(*(np.array(c.xy) - move.fixed)) > reach
    )
    return replace(
        topology, sections=tuple(sections), branch_points=tuple(points), crossings=crossings
    )


def _led_to(section: Section, end: int, xy: FloatArray, reach: float) -> Section:
    """The section straight from a point to what is farther from its end than ``reach``."""
    line = section.xy if end == 0 else section.xy[::-1]
    lengths = arc_lengths(line)
    line = np.concatenate([xy[None], line[lengths > min(reach, lengths[-1] / 2)]])
    return with_line(section, line if end == 0 else line[::-1])


def with_line(section: Section, xy: FloatArray) -> Section:
    """The section along another polyline ``(n, 2)``."""
    return replace(section, xy=xy, length=float(arc_lengths(xy)[-1]))
