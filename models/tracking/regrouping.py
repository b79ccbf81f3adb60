"""Where the picture and the track differ about which strand goes on as which, and who is right.

Strategy: an observation on which one cable follows another joins them; the track holds them apart.
A cable is firmly known to go on where it was once seen alone: away from crossings and other
strands. Such knowledge is kept through any tangle. Where neither cable has it, because they were
met together, the picture is believed: one cable is extended, what it was thought to be beyond is
cut off, and so is the other one's part. It is the one by which the more of both stays with the id
that it has. What is known firmly may be wrong, too: it is given up after many more frames that
contradict it than not, and each cable stays where its end was confirmed more often. Two cables that
pictures go on to join, and of which nothing else is seen, share one strand: each is thought to go
on out of view just where the other one is. After some such frames they become the older one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.tracking.ownership import TANGLED_WIDTHS, Run
from models.tracking.placing import Piece, pinned_down
from models.tracking.state import NODES, TrackedCable

_NEAR_WIDTHS = 3.0
"""A cable is firmly known to go on if it is firm so far on."""
_LEAST_WIDTHS = 4.0
"""What is left of a cable and is shorter is no cable."""
_DIRECTED, _COS_CORNER = 4, 0.3
"""Samples that give a direction; cosine of the angle of a corner."""
_LONG_KNOWN = 100
"""A cable that was met in so many frames is one of its own."""
_SHARED_FRAMES, _CONTRADICTED_FRAMES = 6, 12
"""So often more than not pictures join two cables that then become one, and others whose parts are
then exchanged."""


class _Side(NamedTuple):
    """A cable at a junction: its part up to there is from ``start`` to ``stop`` px of it; ``last``
    whether the junction is at ``stop``; ``firm`` whether the cable is known to go on or to end
    there, ``left`` whether it left the picture."""

    cable: int
    start: float
    stop: float
    last: bool
    firm: bool
    left: bool


Kept = tuple[float, float] | None
"""From where to where, px, a cable stays; None for nowhere."""


def cuts(
    found: Sequence[Run], own: Mapping[int, Mapping[int, Piece]], cables: Sequence[TrackedCable]
) -> tuple[dict[int, Kept], set[int]]:
    """By index of the cable, what remains of those that the picture joins otherwise than the track
    does; and which cables it joins although the track holds them firmly apart."""
    out: dict[int, Kept] = {}
    joined: set[int] = set()
    for k, (a, b) in enumerate(pairwise(found)):
        if not _joined(a, b) or a.cable < 0 or b.cable < 0 or {a.cable, b.cable} & out.keys():
            continue
        if k not in own.get(a.cable, {}) or k + 1 not in own.get(b.cable, {}):
            continue
        sides = (
            _side(own[a.cable][k], a.cable, cables, True),
            _side(own[b.cable][k + 1], b.cable, cables, False),
        )
        if any(side.left for side in sides) or all(
            _ends_there(side, cables[side.cable]) for side in sides
        ):
            continue
        if any(side.firm for side in sides):
            joined |= {a.cable, b.cable}
        decided = _decided(sides, (k, k + 1), own, cables)
        if decided is not None:
            out |= decided
    return out, joined


def _decided(
    sides: tuple[_Side, _Side],
    numbers: tuple[int, int],
    own: Mapping[int, Mapping[int, Piece]],
    cables: Sequence[TrackedCable],
) -> dict[int, Kept] | None:
    """What remains of two cables whose pieces of these ``numbers`` the picture joins; None where
    the track is right, or may be."""
    here = [own[side.cable][k].length_px for side, k in zip(sides, numbers, strict=True)]
    stays = [
        2 * length - _seen_px(own[side.cable]) for length, side in zip(here, sides, strict=True)
    ]
    if any(side.firm for side in sides):
        times = min(cables[side.cable].joined for side in sides)
        older, newer = sorted(sides, key=lambda side: -cables[side.cable].met)
        if (
            times >= _SHARED_FRAMES
            and _fits(older, newer, own, cables)
            and _share(sides, numbers, own)
        ):
            return {older.cable: (older.start, older.stop), newer.cable: None}
        if times < _CONTRADICTED_FRAMES:
            return None
        stays = [float(_confirmed(side, cables[side.cable])) for side in sides]
    winner, loser = sides if stays[0] >= stays[1] else sides[::-1]
    others = [piece for number, piece in own[loser.cable].items() if number not in numbers]
    return {
        winner.cable: (winner.start, winner.stop),
        loser.cable: _rest(loser, cables[loser.cable], others),
    }


def _seen_px(pieces: Mapping[int, Piece]) -> float:
    return sum(piece.length_px for piece in pieces.values())


def _confirmed(side: _Side, cable: TrackedCable) -> int:
    """How many frames more confirmed the end of the cable on this side of the junction than its
    other end: the one that was confirmed less often came to the cable later."""
    first, last = (-min(count, 0) for count in cable.doubted)
    return first - last if side.last else last - first


def _share(
    sides: tuple[_Side, _Side], numbers: tuple[int, int], own: Mapping[int, Mapping[int, Piece]]
) -> bool:
    """Whether of none of both a part is seen beyond the junction."""
    return all(
        _alone_beyond(side, k, own[side.cable]) for side, k in zip(sides, numbers, strict=True)
    )


def _fits(
    older: _Side,
    newer: _Side,
    own: Mapping[int, Mapping[int, Piece]],
    cables: Sequence[TrackedCable],
) -> bool:
    """Whether the newer cable may be what is out of view of the older one: neither is long known,
    nor both together longer than the older one is known to be."""
    whole, part = cables[older.cable], cables[newer.cable]
    end = whole.ends[1 if older.last else 0]
    room = whole.length_px - _seen_px(own[older.cable]) + _NEAR_WIDTHS * whole.width_px
    return part.met < min(_LONG_KNOWN, whole.met) and (
        end != "free" or _seen_px(own[newer.cable]) < room
    )


def cut(cable: TrackedCable, kept: tuple[float, float]) -> TrackedCable:
    """The part of a cable from ``kept[0]`` to ``kept[1]`` px of it."""
    old, new = np.linspace(0.0, cable.length_px, NODES), np.linspace(*kept, NODES)
    xy, velocity = (
        np.stack([np.interp(new, old, axis) for axis in values.T], axis=1)
        for values in (cable.xy, cable.velocity)
    )
    middle = 0.5 * (old[1:] + old[:-1]), 0.5 * (new[1:] + new[:-1])
    nearest = np.rint(np.clip(new / cable.length_px, 0, 1) * (NODES - 1)).astype(int)
    return replace(
        cable,
        xy=xy,
        velocity=velocity,
        seen=cable.seen[nearest],
        firm=cable.firm[nearest],
        spread=cable.spread[nearest],
        course=np.interp(middle[1], middle[0], cable.course),
        closed=False,
        length_px=kept[1] - kept[0],
        start_px=cable.start_px + kept[0],
        ends=(
            cable.ends[0] if kept[0] <= 0 else "hidden",
            cable.ends[1] if kept[1] >= cable.length_px else "hidden",
        ),
    )


def extended(
    found: Sequence[Run], own: dict[int, dict[int, Piece]], cables: Sequence[TrackedCable]
) -> tuple[set[int], set[tuple[int, int]]]:
    """Give runs without an owner that follow on a cable to it, in ``own``, where it was not known
    to end, and where it was known to go on, but all that is beyond is out of view: it was supposed
    to be elsewhere; returns their numbers, and beyond which ends (index of the cable, 0 or 1),
    known to be free, such runs follow."""
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
            side, cable = _side(piece, run.cable, cables, at_stop), cables[run.cable]
            if _ends_there(side, cable) and side.firm:
                beyond.add((run.cable, int(side.last)))
            elif _ends_there(side, cable) or _alone_beyond(side, number, own[run.cable]):
                own[run.cable][number] = pinned_down(_longer(piece, more, side), cable)
                taken.add(other)
    return taken, beyond


def _ends_there(side: _Side, cable: TrackedCable) -> bool:
    """Whether the junction is at an end of the cable."""
    beyond = cable.length_px - side.stop if side.last else side.start
    return beyond < _NEAR_WIDTHS * cable.width_px


def _alone_beyond(side: _Side, number: int, pieces: Mapping[int, Piece]) -> bool:
    """Whether no other one of the cable's pieces is beyond the junction."""
    others = [piece for k, piece in pieces.items() if k != number]
    if side.last:
        return all(piece.position[-1] <= side.stop for piece in others)
    return all(piece.position[0] >= side.start for piece in others)


def _joined(a: Run, b: Run) -> bool:
    """Whether the picture shows clearly that ``b`` follows on ``a``: both are alone soon before and
    after."""
    if b.came_in or a.observed is not b.observed or a.cable == b.cable:
        return False
    before, after = np.flatnonzero(a.trust >= 1), np.flatnonzero(b.trust >= 1)
    if not len(before) or not len(after):
        return False
    near = b.along[after[0]] - a.along[before[-1]] < TANGLED_WIDTHS * a.observed.width_px
    return bool(near) and _straight_on(a.xy[: before[-1] + 1], b.xy[after[0] :])


def _straight_on(a: FloatArray, b: FloatArray) -> bool:
    """Whether ``b`` (n, 2) follows on ``a`` (m, 2) without a corner: cables bend, strands that meet
    at the edge of an arm do not."""
    before, after = a[-1] - a[max(len(a) - _DIRECTED, 0)], b[min(_DIRECTED, len(b)) - 1] - b[0]
    return float(before @ after) >= _COS_CORNER * float(np.hypot(*before) * np.hypot(*after))


def _side(piece: Piece, i: int, cables: Sequence[TrackedCable], at_stop: bool) -> _Side:
    """``at_stop``: the junction is where the run stops along its observation, else where it
    begins."""
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
        around = (lengths >= at - (0.5 * near if last else near)) & (
            lengths <= at + (near if last else 0.5 * near)
        )
        firm = bool((cable.firm[around] >= 1).all()) or cable.closed
    return _Side(i, 0.0 if last else at, at if last else cable.length_px, last, firm, left)


def _rest(side: _Side, cable: TrackedCable, others: Sequence[Piece]) -> Kept:
    """What is beyond the junction, if one of the ``others`` is there and it is enough for a
    cable."""
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
            xy=np.concatenate([piece.xy, xy]),
            position=np.concatenate([piece.position, piece.position[-1] + steps]),
            trust=np.concatenate([piece.trust, trust]),
            u1=u,
        )
    return piece._replace(
        xy=np.concatenate([xy[::-1], piece.xy]),
        trust=np.concatenate([trust[::-1], piece.trust]),
        u0=u,
        position=np.concatenate([(piece.position[0] - steps)[::-1], piece.position]),
    )
