"""Which pieces of the observations are which tracked cable, and how sure that is.

Strategy: the owners of all places are found where the cables are expected
(:mod:`models.tracking.ownership`). What is left over may be a cable that was not met there: it was
out of view, or moved far. Such stretches and the cables without any piece are assigned to one
another, at least cost of length, width, color and distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.arrays import FloatArray
from models.geometry.polylines import resample
from models.tracking.consistency import contradicting
from models.tracking.course import recognised
from models.tracking.ownership import Run, Samples, costs_of, runs
from models.tracking.placing import Piece, piece_at, placed
from models.tracking.regrouping import Kept, cuts, extended
from models.tracking.sliding import slid
from models.tracking.state import MOST_SPREAD_WIDTHS, NODES, Observation, TrackedCable
from models.tracking.tails import claimed

_ROUNDS, _FORBIDDEN = 3, 1e3
"""So often owners are found anew, without those that contradict one another."""
_FEWEST_ALONE, _CERTAIN = 2, 1.5
"""So many samples at least are alone in a run that is certainly a cable's, and so much cheaper than
another cable's."""
_INDEPENDENT = 4.0
"""Neighboring samples err alike: so many count as one."""
_REACH_WIDTHS, _REACH_MISSED, _MOST_REACH_WIDTHS = 8.0, 2.0, 60.0
"""How far from where it is expected a cable may be met: in widths, and more for every frame in
which it was missed."""
_COLOR, _MOTTLED, _WIDTH, _LENGTH = 25.0, 2.0, 0.7, 0.5
"""Differences that cost half as much as the whole reach: Lab distance, log of the widths' and of
the lengths' ratio."""
_ACCEPTED = 1.0
_SHARPNESS = 0.1
"""Of two candidates, the one that costs this much more is e times less likely."""


class Match(NamedTuple):
    """The pieces of one cable in this frame, the longest first; ``probability`` that they are this
    cable; ``goes_on`` whether a strand that no cable owns follows on it at its first and at its
    last end; ``joined`` whether the picture joins it to a cable that is known to be another one."""

    pieces: tuple[Piece, ...]
    probability: float
    goes_on: tuple[bool, bool] = (False, False)
    joined: bool = False


def assign(
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
    observations: Sequence[Observation],
    samples: Samples | None,
) -> tuple[dict[int, Match], list[Run], dict[int, Kept]]:
    """Matches by index of the cable, the runs that belong to none, and cables that should be cut
    first."""
    if samples is None:
        return {}, [], {}
    found, own, refused = _owned(cables, expected, observations, samples)
    changed, joined = cuts(found, own, cables)
    taken, on = extended(found, own, cables)
    nobodys = [
        k for k, run in enumerate(found) if (run.cable < 0 or k in refused) and k not in taken
    ]
    taken |= claimed(found, nobodys, own, cables, expected)
    matches = {}
    for i, pieces in own.items():
        goes_on = (i, 0) in on, (i, 1) in on
        matches[i] = _match(i, pieces, found, cables, expected)._replace(
            goes_on=goes_on, joined=i in joined
        )
    left = [found[k] for k in nobodys if k not in taken]
    return matches, _found_again(cables, expected, matches, left), changed


def assign_certain(
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
    observations: Sequence[Observation],
    samples: Samples | None,
) -> tuple[dict[int, Match], list[Run]]:
    """Matches by index of the cable, of those pieces alone that no other cable may own, and runs
    that are so far from all cables that they are none of them: for pictures in which something
    covers a part of the cables."""
    if samples is None:
        return {}, []
    found, own, _ = _owned(cables, expected, observations, samples)
    certain = {
        i: {k: piece for k, piece in pieces.items() if _certain(found[k], i)}
        for i, pieces in own.items()
    }
    matches = {
        i: _match(i, pieces, found, cables, expected) for i, pieces in certain.items() if pieces
    }
    nodes = np.concatenate([np.zeros((0, 2)), *expected])
    return matches, [run for run in found if run.cable < 0 and _far(run, nodes)]


def _far(run: Run, nodes: FloatArray) -> bool:
    """Whether a run is farther from all ``nodes`` (n, 2) than any of them may be from where it is
    expected."""
    away = run.xy[:, None] - nodes
    return bool(
        (np.hypot(away[..., 0], away[..., 1]) > MOST_SPREAD_WIDTHS * run.observed.width_px).all()
    )


def _owned(
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
    observations: Sequence[Observation],
    samples: Samples,
) -> tuple[list[Run], dict[int, dict[int, Piece]], list[int]]:
    """All runs, the pieces by index of the cable and number of the run, and numbers of runs that
    contradict them."""
    costs, places = costs_of(samples, observations, cables, expected)
    for _ in range(_ROUNDS):
        found = runs(samples, observations, cables, costs, places)
        own = _placed(found, cables)
        gains = {k: _gain(run) for k, run in enumerate(found)}
        refused = [k for i, pieces in own.items() for k in contradicting(pieces, cables[i], gains)]
        if not refused:
            break
        for k in refused:
            costs[found[k].first : found[k].stop, found[k].cable] = _FORBIDDEN
    own = {
        i: {k: piece for k, piece in pieces.items() if k not in refused}
        for i, pieces in own.items()
    }
    return found, own, refused


def _match(
    i: int,
    pieces: Mapping[int, Piece],
    found: Sequence[Run],
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
) -> Match:
    """Of the cable of index ``i`` with its ``pieces`` by the number of the run."""
    of_it = recognised(slid(list(pieces.values()), cables[i], expected[i]), cables[i], expected[i])
    longest = sorted(of_it, key=lambda piece: -piece.length_px)
    return Match(tuple(longest), _probability(i, [found[k] for k in pieces]))


def _certain(run: Run, i: int) -> bool:
    """Whether a run is of the cable of index ``i`` and clearly of no other one, where its strand is
    alone."""
    alone = run.cost[run.trust >= 1]
    if len(alone) < _FEWEST_ALONE:
        return False
    others = np.delete(alone, (i, -1), axis=1).min(1, initial=np.inf)
    return float(np.minimum(others - alone[:, i], _FORBIDDEN).mean()) >= _CERTAIN


def _placed(found: Sequence[Run], cables: Sequence[TrackedCable]) -> dict[int, dict[int, Piece]]:
    """By index of the cable, its pieces by the number of the run."""
    own: dict[int, dict[int, Piece]] = {}
    for k, run in enumerate(found):
        if run.cable >= 0 and len(run.along) > 1:
            own.setdefault(run.cable, {})[k] = placed(run, cables[run.cable])
    return own


def _gain(run: Run) -> float:
    """By how much it is likelier to be its cable's than nobody's."""
    return float((run.cost[:, -1] - run.cost[:, run.cable]).sum())


def _probability(i: int, mine: Sequence[Run]) -> float:
    """That the cable of index ``i`` owns its runs, and no other cable does."""
    costs = np.concatenate([run.cost for run in mine])[:, :-1]
    log_odds = (costs.mean(0) - costs[:, i].mean()) * len(costs) / _INDEPENDENT
    return float(1.0 / np.exp(-np.clip(log_odds, -20, 20)).sum())


def _found_again(
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
    matches: dict[int, Match],
    left: list[Run],
) -> list[Run]:
    """Give cables without a match those of the runs that are they; returns the others."""
    away = [i for i in range(len(cables)) if i not in matches]
    long = [run for run in left if len(run.along) > 1 and run.length_px > run.observed.width_px]
    if not away or not long:
        return left
    options = [[_option(run, cables[i], expected[i]) for run in long] for i in away]
    costs = np.array([[cost for cost, _ in row] for row in options])
    reach = np.array([_reach(cables[i]) for i in away])
    taken = set()
    for row, column in zip(*linear_sum_assignment(np.minimum(costs, _ACCEPTED)), strict=True):
        if costs[row, column] < _ACCEPTED:
            likely = (
                np.exp(-(costs[:, column] - costs[row, column]) / _SHARPNESS)
                * (reach[row] / reach) ** 2
            )
            matches[away[row]] = Match((options[row][column][1],), float(1 / likely.sum()))
            taken.add(id(long[column]))
    return [run for run in left if id(run) not in taken]


def _option(run: Run, cable: TrackedCable, expected: FloatArray) -> tuple[float, Piece]:
    """Cost of a cable that is met as ``run``, the better way round, and where it then is."""
    points = resample(run.xy, NODES)
    ways = []
    for sign in (1.0, -1.0):
        nodes = expected if sign > 0 else expected[::-1]
        share = min(run.length_px / cable.length_px, 1.0)
        first, distance = _best_start(points, nodes, share)
        at = first * cable.length_px if sign > 0 else (1 - first) * cable.length_px
        ways.append((distance, piece_at(run, cable, sign, at - sign * float(run.along[0]))))
    distance, piece = min(ways, key=lambda way: way[0])
    cost = distance / _reach(cable)
    cost += min(abs(np.log(run.observed.width_px / cable.width_px)) / _WIDTH, 1.0) * 0.5
    if run.observed.color is not None and cable.color is not None:
        cost += (
            min(
                float(np.linalg.norm(run.observed.color - cable.color))
                / (_COLOR + _MOTTLED * run.observed.mottled),
                3.0,
            )
            * 0.5
        )
    longer = run.length_px / cable.length_px
    if longer > 1 and "free" in cable.ends:
        cost += min(float(np.log(longer)) / _LENGTH, 1.0) * 0.5
    return float(cost), piece


def _best_start(points: FloatArray, nodes: FloatArray, share: float) -> tuple[float, float]:
    """Where on a cable of ``nodes`` a piece of ``share`` of its length is nearest, and how far off
    it is then."""
    starts = np.linspace(0.0, 1.0 - share, 5) if share < 0.9 else np.zeros(1)
    index = np.clip(
        (starts[:, None] + share * np.linspace(0, 1, NODES)) * (NODES - 1), 0, NODES - 1
    )
    distance = np.hypot(*(points - nodes[np.rint(index).astype(int)]).transpose(2, 0, 1)).mean(1)
    best = int(distance.argmin())
    return float(starts[best]), float(distance[best])


def _reach(cable: TrackedCable) -> float:
    """Px within which a cable may be met."""
    return min(_REACH_WIDTHS + _REACH_MISSED * cable.missed, _MOST_REACH_WIDTHS) * cable.width_px
