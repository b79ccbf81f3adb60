"""Strands that no cable owns, as the tails that known cables lack.

Strategy: cables do not begin in the open. A strand that comes out of a tangle or from under an arm
and is no known cable's there, while a cable that goes in does not come out, is that cable's tail:
it was only supposed to be elsewhere. Each such strand is laid on each tail out of view: the gap
between them, its turns, its length where the end of both is known, and how far it is from where the
tail was supposed to be tell what that costs. Of all pairs the cheapest are taken together.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.arrays import FloatArray
from models.tracking.nodes import between
from models.tracking.ownership import Run, unlike
from models.tracking.placing import Piece, pinned_down
from models.tracking.state import NODES, TrackedCable

_LEAST_WIDTHS = 4.0
"""What is shorter is no tail, and no strand."""
_GAP_WIDTHS, _LENGTH_WIDTHS, _OF_LENGTH = 4.0, 4.0, 0.04
"""By which gap and length are usually off, and the share of its length that a cable may be off
besides."""
_TURN_RAD = 0.8
_AWAY_WIDTHS, _AWAY = 5.0, 0.4
"""By how much a tail is usually elsewhere: in widths, and as a share of how far on it is."""
_ACCEPTED = 3.0
"""Highest cost, of four that are 1 where something is off as usual."""


class _Tail(NamedTuple):
    """What is out of view of the cable of this index, beyond its first or (``last``) its last
    piece: it begins at ``xy`` (2,), ``at`` px of the cable, and leads in the ``direction`` (2,)."""

    cable: int
    last: bool
    xy: FloatArray
    direction: FloatArray
    at: float
    length_px: float


def claimed(
    found: Sequence[Run],
    left: Collection[int],
    own: dict[int, dict[int, Piece]],
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
) -> set[int]:
    """Give those of the runs of the numbers ``left`` that are tails of cables to these, in ``own``;
    returns their numbers."""
    tails = _tails(own, cables)
    strands = [k for k in left if found[k].length_px >= _LEAST_WIDTHS * found[k].observed.width_px]
    if not tails or not strands:
        return set()
    options = [
        [_option(found[k], tail, cables[tail.cable], expected[tail.cable]) for k in strands]
        for tail in tails
    ]
    costs = np.array([[cost for cost, _ in row] for row in options])
    taken = set()
    for row, column in zip(*linear_sum_assignment(np.minimum(costs, _ACCEPTED)), strict=True):
        if costs[row, column] < _ACCEPTED:
            own[tails[row].cable][strands[column]] = options[row][column][1]
            taken.add(strands[column])
    return taken


def _tails(own: Mapping[int, Mapping[int, Piece]], cables: Sequence[TrackedCable]) -> list[_Tail]:
    out = []
    for i, pieces in own.items():
        cable = cables[i]
        if cable.closed or not pieces:
            continue
        first = min(pieces.values(), key=lambda piece: float(piece.position[0]))
        last = max(pieces.values(), key=lambda piece: float(piece.position[-1]))
        for piece, at_last in ((first, False), (last, True)):
            at = float(piece.position[-1 if at_last else 0])
            hidden = cable.length_px - at if at_last else at
            if hidden >= _LEAST_WIDTHS * cable.width_px and len(piece.xy) > 1:
                ends = (
                    piece.xy[[-1, max(-4, -len(piece.xy))]]
                    if at_last
                    else piece.xy[[0, min(3, len(piece.xy) - 1)]]
                )
                out.append(_Tail(i, at_last, ends[0], _unit(ends[0] - ends[1]), at, hidden))
    return out


def _option(
    run: Run, tail: _Tail, cable: TrackedCable, expected: FloatArray
) -> tuple[float, Piece]:
    """Cost of ``run`` as the tail, the better way round, and where it then is."""
    return min(
        (_laid(run, way, tail, cable, expected) for way in (1, -1)), key=lambda option: option[0]
    )


def _laid(
    run: Run, way: int, tail: _Tail, cable: TrackedCable, expected: FloatArray
) -> tuple[float, Piece]:
    """The same of the run whose first (``way`` 1) or last sample follows on the tail's
    beginning."""
    xy, along = run.xy[::way], np.abs(run.along[::way] - run.along[::way][0])
    gap = xy[0] - tail.xy
    wide = float(np.hypot(*gap))
    outward = 1.0 if tail.last else -1.0
    over = wide + float(along[-1]) - tail.length_px
    u = (run.along[::way] / max(run.observed.length_px, 1e-9))[[0, -1]].tolist()
    ends_free = cable.ends[1 if tail.last else 0] == "free" and _free_end(run, u[1])
    if not ends_free and cable.ends[1 if tail.last else 0] != "free":
        over = 0.0
    elif not ends_free:
        over = max(over, 0.0)
    start = max(tail.length_px - float(along[-1]), 0.0) if ends_free else wide
    position = tail.at + outward * (start + along)
    nodes = between(expected, position * ((NODES - 1) / cable.length_px))
    away = float(
        (
            np.hypot(*(xy - nodes).T) / (_AWAY_WIDTHS * cable.width_px + _AWAY * (start + along))
        ).mean()
    )
    heading = _unit(xy[min(3, len(xy) - 1)] - xy[0])
    chord = _unit(gap) if wide > cable.width_px else tail.direction
    turns = _angle(tail.direction, chord), _angle(chord, heading)
    cost = away**2 + (over / (_LENGTH_WIDTHS * cable.width_px + _OF_LENGTH * cable.length_px)) ** 2
    cost += (turns[0] ** 2 + turns[1] ** 2) / _TURN_RAD**2 + unlike(run.observed, cable)
    cost += (wide / (_GAP_WIDTHS * cable.width_px + 0.5 * tail.length_px)) ** 2
    order = slice(None) if tail.last else slice(None, None, -1)
    ends = u if tail.last else u[::-1]
    piece = Piece(
        run.observed, xy[order], position[order], ends[0], ends[1], False, run.trust[::way][order]
    )
    return cost, pinned_down(piece, cable)


def _free_end(run: Run, u: float) -> bool:
    return run.observed.ends[0 if u < 0.5 else 1] == "free" and min(u, 1 - u) < 0.01


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / max(float(np.hypot(*vector)), 1e-9))


def _angle(a: FloatArray, b: FloatArray) -> float:
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
