"""Which observation is which tracked cable, piece by piece, and how sure that is.

Strategy: whole observations are assigned to cables first, at least cost in all. But where strands of one look cross,
a single picture may go on with the wrong one: every observation is cut at its crossings, and each piece goes to the
cable that is expected there, against a small price for leaving the cable of the whole. Pieces of one cable do not
overlap along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.arrays import FloatArray
from models.tracking.alignment import Alignment, align, align_part
from models.tracking.state import Observation, TrackedCable

_REACH_WIDTHS, _REACH_MISSED, _MOST_REACH_WIDTHS = 8.0, 2.0, 60.0
"""How far from where it is expected a cable may be met: in widths, and more for every frame in which it was missed."""
_COLOR, _WIDTH, _LENGTH = 25.0, 0.7, 0.5
"""Differences that cost half as much as the whole reach: Lab distance, log of the widths' and of the lengths' ratio."""
_ACCEPTED = 1.3
_SHARPNESS = 0.05
"""Of two candidates, the one that costs this much more is e times less likely."""
_OVERLAP = 0.3
"""Pieces of one cable overlap by less than this share of the shorter one."""
_LEAVING = 0.35
"""Price of a piece that leaves the cable to which the rest of its observation belongs."""


class Piece(NamedTuple):
    """An observation, or a part of one, and where on its cable it is."""

    observed: Observation
    alignment: Alignment


class Match(NamedTuple):
    """The pieces of one cable in this frame, the longest first; ``probability`` that they are this cable."""

    pieces: tuple[Piece, ...]
    probability: float


def assign(
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
    whole: Sequence[Observation],
    parts: Sequence[Observation],
) -> dict[int, Match]:
    """Matches by index of the cable, from ``whole`` observations and the ``parts`` between their crossings. A part is
    given to one cable at most."""
    if not cables or not whole:
        return {}
    owners = _owners(cables, expected, whole)
    reaches = np.array([_reach(cable) for cable in cables])
    found = [
        [
            align_part(part, owners[part.number][1], c, e) if _owner(owners, part) == i else align(part, c, e)
            for i, (c, e) in enumerate(zip(cables, expected, strict=True))
        ]
        for part in parts
    ]
    costs = np.array(
        [[_cost(a, c, p) for a, c in zip(row, cables, strict=True)] for row, p in zip(found, parts, strict=True)]
    )
    leaving = np.array([[_LEAVING * (_owner(owners, p) not in (-1, i)) for i in range(len(cables))] for p in parts])
    lost = np.array(
        [[_ACCEPTED * (c.missed > 0 and _owner(owners, p) != i) for i, c in enumerate(cables)] for p in parts]
    )
    total = costs + leaving + lost
    taken: dict[int, list[int]] = {}
    for j, i in _by_cost(total):
        if all(j not in used for used in taken.values()) and _fits(found, taken.get(i, []), j, i, cables[i]):
            taken.setdefault(i, []).append(j)
    return {i: _match(i, used, parts, found, costs, reaches) for i, used in taken.items()}


def _owners(
    cables: Sequence[TrackedCable], expected: Sequence[FloatArray], whole: Sequence[Observation]
) -> dict[int, tuple[int, Alignment]]:
    """By the number of the observation, at the least sum of costs: index of the cable, and where on it."""
    found = [[align(o, c, e) for o in whole] for c, e in zip(cables, expected, strict=True)]
    costs = np.array(
        [[_cost(a, c, o) for a, o in zip(row, whole, strict=True)] for row, c in zip(found, cables, strict=True)]
    )
    rows, columns = linear_sum_assignment(np.minimum(costs, _ACCEPTED))
    return {
        whole[j].number: (int(i), found[i][j]) for i, j in zip(rows, columns, strict=True) if costs[i, j] < _ACCEPTED
    }


def _owner(owners: dict[int, tuple[int, Alignment]], part: Observation) -> int:
    """Index of the cable that has the whole of the part's observation; -1 for none."""
    return owners[part.number][0] if part.number in owners else -1


def _by_cost(total: FloatArray) -> list[tuple[int, int]]:
    """Pairs of part and cable that are acceptable, the cheapest first."""
    order = np.argsort(total, axis=None, kind="stable")
    pairs = (np.unravel_index(k, total.shape) for k in order)
    return [(int(j), int(i)) for j, i in pairs if total[j, i] < _ACCEPTED]


def _fits(found: list[list[Alignment]], used: list[int], j: int, i: int, cable: TrackedCable) -> bool:
    """Whether part ``j`` can be on cable ``i`` beside the parts that it has."""
    here = found[j][i]
    room = 0.1 * cable.length_px
    if cable.ends[0] == "free" and here.start < -room:
        return False
    if cable.ends[1] == "free" and here.stop > cable.length_px + room:
        return False
    return all(_apart(here, found[k][i]) for k in used)


def _cost(alignment: Alignment, cable: TrackedCable, observed: Observation) -> float:
    cost = alignment.distance / _reach(cable)
    cost += min(abs(np.log(observed.width_px / cable.width_px)) / _WIDTH, 1.0) * 0.5
    if observed.color is not None and cable.color is not None:
        cost += min(float(np.linalg.norm(observed.color - cable.color)) / _COLOR, 3.0) * 0.5
    longer = (alignment.stop - alignment.start) / cable.length_px
    if longer > 1 and "free" in cable.ends:
        cost += min(float(np.log(longer)) / _LENGTH, 1.0) * 0.5
    return float(cost)


def _reach(cable: TrackedCable) -> float:
    """Px within which a cable may be met."""
    return min(_REACH_WIDTHS + _REACH_MISSED * cable.missed, _MOST_REACH_WIDTHS) * cable.width_px


def _apart(a: Alignment, b: Alignment) -> bool:
    shared = min(a.stop, b.stop) - max(a.start, b.start)
    return shared < _OVERLAP * min(a.stop - a.start, b.stop - b.start)


def _match(
    i: int,
    used: list[int],
    parts: Sequence[Observation],
    found: list[list[Alignment]],
    costs: FloatArray,
    reaches: FloatArray,
) -> Match:
    """Where a cable may be anywhere within a wide reach, it is less likely to be just here."""
    used = sorted(used, key=lambda j: -parts[j].length_px)
    lengths = np.array([parts[j].length_px for j in used])
    likely = np.exp(-(costs[used] - costs[used, i][:, None]) / _SHARPNESS) * (reaches[i] / reaches) ** 2
    probability = float(np.average(1.0 / likely.sum(1), weights=lengths))
    return Match(tuple(Piece(parts[j], found[j][i]) for j in used), probability)
