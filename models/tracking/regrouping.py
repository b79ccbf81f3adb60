"""Where the picture and the track differ about which strand goes on as which, and who is right.

Strategy: an observation on which one cable follows another joins them; the track holds them apart. A cable is firmly
known to go on where it was once seen alone: away from crossings and other strands. Such knowledge is kept through any
tangle. Where neither cable has it, because they were met together, the picture is believed: the longer cable is
extended, what it was thought to be beyond is cut off, and so is the other one's part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from models.tracking.ownership import TANGLED_WIDTHS, Run
from models.tracking.placing import Piece
from models.tracking.state import NODES, TrackedCable

_NEAR_WIDTHS = 3.0
"""A cable is firmly known to go on if it is firm so far on."""
_LEAST_WIDTHS = 4.0
"""What is left of a cable and is shorter is no cable."""


class _Side(NamedTuple):
    """A cable at a junction: its part up to there is from ``start`` to ``stop`` px of it; ``last`` whether the junction
    is at ``stop``; ``firm`` whether the cable is known to go on or to end there, ``left`` whether it left the
    picture."""

    cable: int
    start: float
    stop: float
    last: bool
    firm: bool
    left: bool

    @property
    def length_px(self) -> float:
        return self.stop - self.start


Kept = tuple[float, float] | None
"""From where to where, px, a cable stays; None for nowhere."""


def cuts(
    found: Sequence[Run], own: Mapping[int, Mapping[int, Piece]], cables: Sequence[TrackedCable]
) -> dict[int, Kept]:
    """By index of the cable, what remains of those that the picture joins otherwise than the track does."""
    out: dict[int, Kept] = {}
    for k, (a, b) in enumerate(pairwise(found)):
        if not _joined(a, b) or a.cable < 0 or b.cable < 0 or {a.cable, b.cable} & out.keys():
            continue
        if k not in own.get(a.cable, {}) or k + 1 not in own.get(b.cable, {}):
            continue
        sides = _side(own[a.cable][k], a.cable, cables, True), _side(own[b.cable][k + 1], b.cable, cables, False)
        if any(side.firm or side.left for side in sides):
            continue
        winner, loser = sorted(sides, key=lambda side: -side.length_px)
        out[winner.cable] = winner.start, winner.stop
        others = [piece for number, piece in own[loser.cable].items() if number not in (k, k + 1)]
        out[loser.cable] = _rest(loser, cables[loser.cable], others)
    return out


def cut(cable: TrackedCable, kept: tuple[float, float]) -> TrackedCable:
    """The part of a cable from ``kept[0]`` to ``kept[1]`` px of it."""
    old, new = np.linspace(0.0, cable.length_px, NODES), np.linspace(*kept, NODES)
    xy, velocity = (
        np.stack([np.interp(new, old, axis) for axis in values.T], axis=1) for values in (cable.xy, cable.velocity)
    )
    middle = 0.5 * (old[1:] + old[:-1]), 0.5 * (new[1:] + new[:-1])
    nearest = np.rint(np.clip(new / cable.length_px, 0, 1) * (NODES - 1)).astype(int)
    return replace(
        cable, xy=xy, velocity=velocity, seen=cable.seen[nearest], firm=cable.firm[nearest],
        spread=cable.spread[nearest], course=np.interp(middle[1], middle[0], cable.course), closed=False,
        length_px=kept[1] - kept[0], start_px=cable.start_px + kept[0],
        ends=(cable.ends[0] if kept[0] <= 0 else "hidden", cable.ends[1] if kept[1] >= cable.length_px else "hidden"),
    )  # fmt: skip


def extended(
    found: Sequence[Run], own: dict[int, dict[int, Piece]], cables: Sequence[TrackedCable]
) -> tuple[set[int], set[tuple[int, int]]]:
    """Give runs without an owner that follow on a cable where it was not known to end or go on to it, in ``own``;
    returns their numbers, and beyond which ends (index of the cable, 0 or 1), known to be free, such runs follow."""
    taken: set[int] = set()
    beyond: set[tuple[int, int]] = set()
    for k, (a, b) in enumerate(pairwise(found)):
        for number, other, at_stop in ((k, k + 1, True), (k + 1, k, False)):
            run, more = found[number], found[other]
            if not _joined(a, b) or run.cable < 0 or more.cable >= 0 or other in taken:
                continue
            piece = own.get(run.cable, {}).get(number)
            if piece is None or len(more.along) < 2:
                continue
            side = _side(piece, run.cable, cables, at_stop)
            known = side.start if not side.last else cables[run.cable].length_px - side.stop
            if known < _NEAR_WIDTHS * cables[run.cable].width_px:
                if side.firm:
                    beyond.add((run.cable, int(side.last)))
                else:
                    own[run.cable][number] = _longer(piece, more, side)
                    taken.add(other)
    return taken, beyond


def _joined(a: Run, b: Run) -> bool:
    """Whether the picture shows clearly that ``b`` follows on ``a``: both are alone soon before and after."""
    before, after = np.flatnonzero(a.trust >= 1), np.flatnonzero(b.trust >= 1)
    if b.came_in or a.observed is not b.observed or a.cable == b.cable or not len(before) or not len(after):
        return False
    return bool(b.along[after[0]] - a.along[before[-1]] < TANGLED_WIDTHS * a.observed.width_px)


def _side(piece: Piece, i: int, cables: Sequence[TrackedCable], at_stop: bool) -> _Side:
    """``at_stop``: the junction is where the run stops along its observation, else where it begins."""
    cable = cables[i]
    last = (piece.u0 <= piece.u1) == at_stop
    at = float(np.clip(piece.position[-1 if last else 0], 0.0, cable.length_px))
    near = _NEAR_WIDTHS * cable.width_px
    beyond = cable.length_px - at if last else at
    left = False
    if beyond < near:
        left = cable.ends[1 if last else 0] == "border"
        firm = cable.ends[1 if last else 0] == "free" or cable.closed
    else:
        lengths = np.linspace(0.0, cable.length_px, NODES)
        around = (lengths >= at - (0.5 * near if last else near)) & (lengths <= at + (near if last else 0.5 * near))
        firm = bool((cable.firm[around] >= 1).all()) or cable.closed
    return _Side(i, 0.0 if last else at, at if last else cable.length_px, last, firm, left)


def _rest(side: _Side, cable: TrackedCable, others: Sequence[Piece]) -> Kept:
    """What is beyond the junction, if one of the ``others`` is there and it is enough for a cable."""
    kept = (side.stop, cable.length_px) if side.last else (0.0, side.start)
    middles = [0.5 * float(piece.position[0] + piece.position[-1]) for piece in others]
    if not any(kept[0] < middle < kept[1] for middle in middles):
        return None
    return kept if kept[1] - kept[0] > _LEAST_WIDTHS * cable.width_px else None


def _longer(piece: Piece, more: Run, side: _Side) -> Piece:
    """``piece`` with the samples of ``more`` after its last, or before its first point."""
    nearest_first = more.along[0] > min(piece.u0, piece.u1) * more.observed.length_px
    xy, along, trust = (v if nearest_first else v[::-1] for v in (more.xy, more.along, more.trust))
    steps = np.abs(along - along[0]) + float(np.hypot(*(xy[0] - piece.xy[-1 if side.last else 0])))
    u = float(along[-1]) / max(more.observed.length_px, 1e-9)
    if side.last:
        return piece._replace(
            xy=np.concatenate([piece.xy, xy]), position=np.concatenate([piece.position, piece.position[-1] + steps]),
            trust=np.concatenate([piece.trust, trust]), u1=u,
        )  # fmt: skip
    return piece._replace(
        xy=np.concatenate([xy[::-1], piece.xy]), trust=np.concatenate([trust[::-1], piece.trust]), u0=u,
        position=np.concatenate([(piece.position[0] - steps)[::-1], piece.position]),
    )  # fmt: skip
