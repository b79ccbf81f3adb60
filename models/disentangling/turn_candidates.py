"""Turns that would remove a crossing: the piece beyond a place that is held, turned about it
(thesis Algorithm 7).

The piece is swept as a rigid body over all angles. Each turn comes with the evidence of whether it
will work, for a small network to weigh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from models.disentangling.evidence import (
    CountEvidence,
    RoomEvidence,
    SetBackEvidence,
    held_evidence,
)
from models.disentangling.hands import Frame, allowance
from models.disentangling.hold_candidates import Held, parted_by
from models.disentangling.rigid_piece import set_back, turned
from models.disentangling.sweep import Sweep
from models.geometry.arrays import FloatArray, IntArray
from models.topology.scene import Place, Topology

_ANGLES = np.deg2rad(np.arange(-175.0, 176.0, 5.0))
"""Turns that are tried. Steps of 5 degrees are about what arms err."""
_UNTURNED = len(_ANGLES) // 2
_SIDEWAYS = float(np.tan(np.deg2rad(20)))
"""Near the place held, strands should part by an angle of 20 degrees at least."""
_TURN_ERROR = float(np.sin(np.deg2rad(3)))
"""How far a turned place may end from where it should, per hand from the place held."""
_ERROR_SHARES = (0.59, 0.2, 0.005)
"""How often arms turn within half a step of what they should, one step more (or less), two steps
more (or less)."""
_SET_BACK = (5 / 12, 11 / 12)
"""Hands by which a branch-point may be before the place where the strands are seen to part."""
_FAR, _BESIDE = (4.0, 2 / 3), (1.5, 1 / 3)
"""Widths and hands from the place held: beyond the first the piece should be clear of what rests,
beyond the second it should at least lead away."""
_AMPLE = 8
"""Widths of the piece; more room counts no more."""
_LEAST = 1 / 12
"""Hands below which no distance is wished: a picture does not show less."""


@dataclass(frozen=True, eq=False)
class Turn:
    """``angle``: radians, from x towards y; ``after``: crossings that the simulation counts then; ``clearance``: hands
    to what rests; ``in_view``: share of the piece that ends within the picture and its margin; ``evidence``: columns
    :data:`evidence.MOVE_FEATURES`."""

    held: Held
    angle: float
    after: int
    clearance: float
    in_view: float
    evidence: FloatArray


def find_turns(
    topology: Topology, holds: Sequence[Held], frame: Frame, clearance_widths: float, gain: int = 1
) -> list[Turn]:
    """Turns that leave ``gain`` crossings less than there are, or fewer; some for each of the
    places that are held.

    ``topology`` and ``frame`` are in hands. A gain of 0 adds turns that remove a crossing and make
    another. ``clearance_widths``: wished distance to what rests, in widths.
    """
    return [
        turn
        for held in holds
        for turn in _turns_about(topology, held, frame, clearance_widths, gain)
    ]


def _turns_about(
    topology: Topology, held: Held, frame: Frame, clearance_widths: float, gain: int
) -> list[Turn]:
    """Every other angle of each stretch of angles that leave as many crossings."""
    before = len(topology.crossings)
    kept = before - len(parted_by(topology, range(before), held.body, held.pivot))
    sweep = Sweep(topology, held.body)
    pairs = [[c[:2] for c in sweep.crossings(a)] for a in _ANGLES.tolist()]
    after = np.array([kept + len(p) for p in pairs])
    after[_UNTURNED] = before
    undone = {_pair_of(topology, k, place) for k, place in held.parted}
    good = (after <= before - gain) & ((after < before) | [undone.isdisjoint(p) for p in pairs])
    good[_UNTURNED] = False
    tried = [
        k
        for start, stop in _stretches(np.where(good, after, -1))
        if good[start]
        for k in range(start, stop, 2)
    ]
    if not tried:
        return []
    chances, common = _chances(after), held_evidence(topology, held)
    at_branch = held.pivot.branch >= 0
    bodies = [
        set_back(topology, held.pivot, held.body, away) if at_branch else None for away in _SET_BACK
    ]
    back = [None if body is None else Sweep(topology, body) for body in bodies]
    space = _Space(topology, held, frame, clearance_widths)
    found = []
    for k in tried:
        angle = float(_ANGLES[k])
        clearance, in_view, room = space.at(angle)
        more = [0 if s is None else kept + len(s.crossings(angle)) - int(after[k]) for s in back]
        evidence = (
            *common,
            *_count_evidence(after, k, before, chances),
            *room,
            *SetBackEvidence(*more),
        )
        found.append(Turn(held, angle, int(after[k]), clearance, in_view, np.array(evidence)))
    return found


def _pair_of(topology: Topology, k: int, moving: Place) -> tuple[int, int]:
    """The sections of a crossing, the one that moves first."""
    over, under = topology.crossings[k].over, topology.crossings[k].under
    return moving.section, (under if moving is over else over).section


def _stretches(after: IntArray) -> list[tuple[int, int]]:
    """Bounds of the runs of equal counts."""
    return list(pairwise([0, *(np.flatnonzero(np.diff(after)) + 1).tolist(), len(after)]))


def _beside(after: IntArray, steps: int) -> IntArray:
    """``(2 steps + 1, n)``: the counts at every angle and up to so many steps beside it; the ends
    go on."""
    padded = np.pad(after, steps, mode="edge")
    return np.stack([padded[k : k + len(after)] for k in range(2 * steps + 1)])


def _chances(after: IntArray) -> FloatArray:
    """``(n,)``: how often the crossings left are no more than at the angle, as arms do not turn
    exactly."""
    near, one, two = _ERROR_SHARES
    return np.array([two, one, near, one, two]) @ (_beside(after, 2) <= after)


def _count_evidence(after: IntArray, k: int, before: int, chances: FloatArray) -> CountEvidence:
    one, two = (float(_beside(after, steps)[:, k].max() - after[k]) for steps in (1, 2))
    return CountEvidence(
        before, float(before - after[k]), float(after[k]), one, two, float(chances[k])
    )


class _Space:
    """The room around a body at some angle."""

    def __init__(
        self, topology: Topology, held: Held, frame: Frame, clearance_widths: float
    ) -> None:
        body = held.body
        self._limits = np.array([frame.width, frame.height])
        self._margin = frame.margin
        self._own = topology.sections[held.pivot.section].width
        self._wished = max(clearance_widths * self._own, _LEAST)
        self._center = body.center
        widths = np.array([s.width for s in topology.sections])
        self._lines = [
            (float(widths[k]), xy, np.hypot(*(xy - body.center).T))
            for k, xy in body.moving
            if len(xy)
        ]
        resting = [(k, xy) for k, xy in body.resting if len(xy)]
        self._rest_half = np.repeat(
            [widths[k] / 2 for k, _ in resting], [len(xy) for _, xy in resting]
        )
        self._tree = cKDTree(np.concatenate([xy for _, xy in resting])) if resting else None

    def at(self, angle: float) -> tuple[float, float, RoomEvidence]:
        """Least distance between the outlines of the turned body and the rest, away from the place
        held; the share of the body in view; and the evidence of both."""
        lines = [turned(xy, self._center, angle) for _, xy, _ in self._lines]
        xy = np.concatenate(lines)
        inside = np.minimum(xy, self._limits - xy).min(axis=1)
        clearance, share, sideways, ends = self._room(lines)
        evidence = RoomEvidence(
            clearance=float(np.clip(clearance / self._own, -2, _AMPLE)),
            room_share=share,
            sideways=sideways,
            ends=float(np.clip(ends / self._own, 0, _AMPLE)),
            in_picture=float((inside >= 0).mean()),
            border=float(np.clip(inside.min() / self._own, -_AMPLE, _AMPLE)),
            turn=abs(angle) / np.pi,
        )
        return clearance, float((inside >= -self._margin).mean()), evidence

    def _room(self, lines: list[FloatArray]) -> tuple[float, float, float, float]:
        """The least distance; the least share of what is wished (0 to 1): some widths and what an
        arm may err, nearer to the place held as far apart as an angle of 20 degrees; the least
        distance over that to the place held; and the least from an end to the rest."""
        nothing = float(np.hypot(*self._limits))
        if self._tree is None:
            return nothing, 1.0, 1.0, nothing
        least, share, sideways, ends = nothing, 1.0, 1.0, nothing
        for (width, _, reach), line in zip(self._lines, lines, strict=True):
            away, nearest = self._tree.query(line)
            room = away - self._rest_half[nearest] - width / 2
            far, beside = (reach > allowance(width, *bound) for bound in (_FAR, _BESIDE))
            least = min(least, float(room[far].min(initial=nothing)))
            needed = np.clip(
                _SIDEWAYS * reach[beside],
                _LEAST,
                self._wished + width + _TURN_ERROR * reach[beside],
            )
            share = min(share, float(np.minimum(away[beside] / needed, 1.0).min(initial=1.0)))
            sideways = min(sideways, float((away[beside] / reach[beside]).min(initial=1.0)))
            ends = min(ends, *room[[0, -1]][far[[0, -1]]].tolist(), nothing)
        return least, share * float(np.clip(least / self._wished, 0.0, 1.0)), sideways, ends
