"""Turns that would remove a crossing: the piece beyond a place that is held, turned about it (thesis Algorithm 7).

The piece is swept as a rigid body over all angles. Each turn comes with the evidence of whether it will work, for a
small network to weigh.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from models.disentangling.hold_candidates import HAND_PX, Held, find_holds, parted_by
from models.disentangling.rigid_piece import set_back, turned
from models.disentangling.sweep import Sweep
from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths, point_at
from models.topology.scene import Place, Topology

MOVE_EVIDENCE = 35
"""Numbers that describe a turn: of the place held, of the counts, of the room there is, of a set-back branch-point."""
_ANGLES = np.deg2rad(np.arange(-175.0, 176.0, 5.0))
_UNTURNED = len(_ANGLES) // 2
_SIDEWAYS = float(np.tan(np.deg2rad(20)))
_TURN_ERROR = float(np.sin(np.deg2rad(3)))
"""How far a turned place may end from where it should, per px from the place held."""
_ERROR_SHARES = (0.59, 0.2, 0.005)
"""How often arms turn within half a step of what they should, one step more (or less), two steps more (or less)."""
_SET_BACK_PX = (5.0, 11.0)
"""How far a branch-point may lie before the place where the strands are seen to part."""
_ALIKE = 0.3
"""Sections whose widths differ by a larger log ratio are not the same one."""


@dataclass(frozen=True, eq=False)
class Turn:
    """``angle``: radians, from x towards y; ``after``: crossings that the simulation counts then; ``clearance``: px to
    what rests; ``in_view``: share of the piece that ends within the picture and its margin; ``evidence``: ``(35,)``."""

    held: Held
    angle: float
    after: int
    clearance: float
    in_view: float
    evidence: FloatArray


def find_turns(
    topology: Topology, clearance_widths: float, margin_px: float, gain: int = 1, most_holds: int = 120
) -> list[Turn]:  # fmt: skip
    """Turns that leave ``gain`` crossings less than there are, or fewer; some for each of ``most_holds`` places.

    A gain of 0 adds turns that remove a crossing and make another. ``clearance_widths``: wished distance to what rests,
    in widths; ``margin_px``: how far outside the picture the piece may end.
    """
    holds = find_holds(topology, most_holds)
    return [turn for held in holds for turn in _turns_about(topology, held, clearance_widths, margin_px, gain)]


def _turns_about(
    topology: Topology, held: Held, clearance_widths: float, margin_px: float, gain: int
) -> list[Turn]:  # fmt: skip
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
    tried = [k for start, stop in _stretches(np.where(good, after, -1)) if good[start] for k in range(start, stop, 2)]
    if not tried:
        return []
    chances, common = _chances(after), _held_evidence(topology, held)
    bodies = [set_back(topology, held.pivot, held.body, px) if held.pivot.branch >= 0 else None for px in _SET_BACK_PX]
    back = [None if body is None else Sweep(topology, body) for body in bodies]
    space = _Space(topology, held, clearance_widths, margin_px)
    found = []
    for k in tried:
        angle = float(_ANGLES[k])
        clearance, in_view, room = space.at(angle)
        more = [0 if s is None else kept + len(s.crossings(angle)) - int(after[k]) for s in back]
        evidence = [*common, *_count_evidence(after, k, before), float(chances[k]), *room, abs(angle) / np.pi, *more]
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
    """``(2 steps + 1, n)``: the counts at every angle and up to so many steps beside it; the ends go on."""
    padded = np.pad(after, steps, mode="edge")
    return np.stack([padded[k : k + len(after)] for k in range(2 * steps + 1)])


def _chances(after: IntArray) -> FloatArray:
    """``(n,)``: how often the crossings left are no more than at the angle, as arms do not turn exactly."""
    near, one, two = _ERROR_SHARES
    out: FloatArray = np.array([two, one, near, one, two]) @ (_beside(after, 2) <= after)
    return out


def _count_evidence(after: IntArray, k: int, before: int) -> list[float]:
    """Crossings there are, that go, that are left, and how many more may be left one and two steps beside."""
    beside = [float(_beside(after, steps)[:, k].max()) for steps in (1, 2)]
    return [float(before), float(before - after[k]), float(after[k]), *(most - float(after[k]) for most in beside)]


class _Space:
    """The room around a body as it lies at some angle."""

    def __init__(self, topology: Topology, held: Held, clearance_widths: float, margin_px: float) -> None:
        body = held.body
        self._limits = np.array(topology.size[::-1])
        self._margin = margin_px
        self._own = topology.sections[held.pivot.section].width
        self._wished = max(clearance_widths * self._own, 1.0)
        self._center = body.center
        widths = np.array([s.width for s in topology.sections])
        self._lines = [(float(widths[k]), xy, np.hypot(*(xy - body.center).T)) for k, xy in body.moving if len(xy)]
        resting = [(k, xy) for k, xy in body.resting if len(xy)]
        self._rest_half = np.repeat([widths[k] / 2 for k, _ in resting], [len(xy) for _, xy in resting])
        self._tree = cKDTree(np.concatenate([xy for _, xy in resting])) if resting else None

    def at(self, angle: float) -> tuple[float, float, list[float]]:
        """Least distance between the outlines of the turned body and the rest, px, away from the place held; the share
        of the body in view; and the evidence of both."""
        lines = [turned(xy, self._center, angle) for _, xy, _ in self._lines]
        xy = np.concatenate(lines)
        inside = np.minimum(xy, self._limits - xy).min(axis=1)
        clearance, share, sideways, ends = self._room(lines)
        evidence = [
            float(np.clip(clearance / self._own, -2, 8)), share, sideways, float(np.clip(ends / self._own, 0, 8)),
            float((inside >= 0).mean()), float(np.clip(inside.min() / self._own, -8, 8)),
        ]  # fmt: skip
        return clearance, float((inside >= -self._margin).mean()), evidence

    def _room(self, lines: list[FloatArray]) -> tuple[float, float, float, float]:
        """The least distance; the least share of what is wished (0 to 1): some px and what an arm may err, nearer to
        the place held as far apart as an angle of 20 degrees; the least distance over that to the place held; and the
        least from an end to the rest."""
        nothing = float(np.hypot(*self._limits))
        if self._tree is None:
            return nothing, 1.0, 1.0, nothing
        least, share, sideways, ends = nothing, 1.0, 1.0, nothing
        for (width, _, reach), line in zip(self._lines, lines, strict=True):
            away, nearest = self._tree.query(line)
            room = away - self._rest_half[nearest] - width / 2
            far, beside = reach > 4 * width + 8, reach > 1.5 * width + 4
            least = min(least, float(room[far].min(initial=nothing)))
            needed = np.clip(_SIDEWAYS * reach[beside], 1.0, self._wished + width + _TURN_ERROR * reach[beside])
            share = min(share, float(np.minimum(away[beside] / needed, 1.0).min(initial=1.0)))
            sideways = min(sideways, float((away[beside] / reach[beside]).min(initial=1.0)))
            ends = min(ends, *room[[0, -1]][far[[0, -1]]].tolist(), nothing)
        return least, share * float(np.clip(least / self._wished, 0.0, 1.0)), sideways, ends


def _held_evidence(topology: Topology, held: Held) -> list[float]:
    """What does not depend on the angle: how sure the order, the crossings and the branch-points are; what is held
    and how; how much moves and how far it reaches; what is out of sight."""
    pivot, body = held.pivot, held.body
    section = topology.sections[pivot.section]
    moving, resting = (sum(len(xy) for _, xy in parts) for parts in (body.moving, body.resting))
    reach = max(float(np.hypot(*(xy - body.center).T).max()) for _, xy in body.moving if len(xy))
    crossings = [c.score for c in topology.crossings]
    branches = [b.score for b in topology.branch_points]
    others = [b.xy for k, b in enumerate(topology.branch_points) if k != pivot.branch]
    nearest = min((float(np.hypot(*(np.array(xy) - body.center))) for xy in others), default=np.inf)
    k = held.parted[0][0]
    crossed = topology.sections[held.pick[0]]
    picked = point_at(crossed.xy, arc_lengths(crossed.xy), np.array([held.pick[1]]))[0]
    own = {n for n, _ in body.moving}
    rest_at_border = [s for n, s in enumerate(topology.sections) if n not in own and "border" in s.ends]
    return [
        held.certainty, min(topology.crossings[k].score for k, _ in held.parted), min(crossings),
        topology.branch_points[pivot.branch].score if pivot.branch >= 0 else 1.0, min(branches, default=1.0),
        float(pivot.branch >= 0), *held.room, float(body.leaves_view), float(len(rest_at_border)),
        moving / max(moving + resting, 1), float(np.clip(reach / HAND_PX, 0, 40)),
        float(np.clip(nearest / max(2.5 * section.width, HAND_PX), 0, 6)),
        float(np.clip(np.hypot(*(picked - body.center)) / HAND_PX, 0, 12)),
        float(np.clip(np.hypot(*(np.array(topology.crossings[k].xy) - body.center)) / HAND_PX, 0, 12)),
        float(len(body.moving)), section.width / HAND_PX, float(len(topology.sections)),
        *_beyond_border(topology, own),
    ]  # fmt: skip


def _beyond_border(topology: Topology, moving: set[int]) -> tuple[float, float]:
    """Whether the piece may come back into the picture: sections that enter it, reach no branch-point, and are as wide
    as one of the piece that leaves it; and from where that leaves to the nearest that enters, in hands."""
    leaving = [(s.xy[end], s.width) for k in moving for s in (topology.sections[k],) for end in (0, -1)
               if s.ends[end] == "border"]  # fmt: skip
    entering = [(s.xy[end], s.width) for k, s in enumerate(topology.sections) for end in (0, -1)
                if k not in moving and s.ends[end] == "border" and max(s.branches) < 0]  # fmt: skip
    alike = [float(np.hypot(*(a - b))) for a, wide in leaving for b, other in entering
             if abs(np.log(wide / other)) < _ALIKE]  # fmt: skip
    return float(len(alike)), float(np.clip(min(alike, default=1e3) / HAND_PX, 0, 40))
