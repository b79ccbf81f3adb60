"""From the graph and the probabilities that networks give to the topology (thesis Algorithm 6,
section 6.6).

Strategy: repair the strands; weigh every site that may be a crossing or a lens and accept the
probable ones, the most probable first, no joint twice; every other joint is a branch-point. Then
walk the strands: a walk goes straight on through a crossing and ends at a branch-point or a free
end. One walk may pass a crossing twice: a self-loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import FloatArray
from models.strands.graph import Web
from models.topology.classifiers import Classifiers, probabilities_of
from models.topology.graph import Graph
from models.topology.heights import raised_odds, touching
from models.topology.order import Surface
from models.topology.repair import repaired
from models.topology.scene import Predictions
from models.topology.sites import (
    Reading,
    Site,
    bend,
    crossing_sites,
    ends_at,
    evidence,
    measure_arm,
)

End = tuple[int, int]
"""A strand and which of its ends: 0 or 1."""
_MOST_ARMS = 8
"""A joint of more is a blob that strands end at."""


@dataclass(frozen=True, eq=False)
class Passage:
    """Strands that go on through a site: its ``middle`` strand, the pairs of strand ends that it
    joins, the probability of this reading, and every place where they cross: how far along the
    middle (0 to 1), and ``(2,)``. ``tips``: strand ends that lie upon or under what goes on there,
    and end."""

    middle: int | None
    pairs: tuple[tuple[End, End], ...]
    score: float
    crossed: tuple[tuple[float, FloatArray], ...]
    tips: tuple[End, ...] = ()


@dataclass(frozen=True, eq=False)
class Solution:
    """``passages``: accepted crossings and lenses; ``branches``: ``(knot, probability)`` of every
    branch-point."""

    web: Web
    passages: tuple[Passage, ...]
    branches: tuple[tuple[int, float], ...]


def solve(
    graph: Graph,
    predictions: Predictions,
    classifiers: Classifiers,
    tint: Callable[[Site], float] | None = None,
    depths: Sequence[Surface] = (),
) -> Solution:
    """Which joints of the graph are crossings and which are branch-points.

    ``tint``: log odds in favor of a crossing by the colors along a site's arms. ``depths``: show
    where strands lie upon one another.
    """
    web = repaired(graph, predictions, classifiers)
    sites = crossing_sites(web)
    scores = _scores(sites, web, graph, predictions, classifiers, tint, depths)
    passages: list[Passage] = []
    taken: set[int] = set()
    for k in np.argsort(scores[:, Reading.BRANCH_POINTS], kind="stable"):
        reading = Reading(int(scores[k].argmax()))
        if reading is not Reading.BRANCH_POINTS and not taken & set(sites[k].knots):
            taken |= set(sites[k].knots)
            passages.append(_passage(web, sites[k], reading, float(scores[k, reading])))
    branches = []
    for knot, ends in ends_at(web).items():
        if knot in taken or len(ends) < 3:
            continue
        passage, left = (
            _many_arms(web, knot, ends) if 4 < len(ends) <= _MOST_ARMS else (None, len(ends))
        )
        if len(ends) == 3:
            passage, left = _touched(web, knot, ends, depths)
        if passage is not None:
            passages.append(passage)
        if left:
            branches.append((knot, _branch_score(knot, sites, scores, web, graph, predictions)))
    return Solution(web, tuple(passages), tuple(branches))


def _scores(
    sites: list[Site],
    web: Web,
    graph: Graph,
    predictions: Predictions,
    classifiers: Classifiers,
    tint: Callable[[Site], float] | None,
    depths: Sequence[Surface],
) -> FloatArray:
    """``(n, 3)`` probabilities of the readings of every site."""
    scores = probabilities_of(
        classifiers.crossing, [evidence(s, web, graph.xy, predictions) for s in sites]
    ).reshape(-1, len(Reading))
    scores[[s.middle is None for s in sites], Reading.LENS] = 0.0
    if tint is not None:
        scores[:, Reading.CROSSING] *= np.exp([tint(s) for s in sites])
    scores[:, Reading.CROSSING] *= np.exp([raised_odds(depths, web, s.arms) for s in sites])
    return scores / scores.sum(axis=1, keepdims=True)


def _passage(web: Web, site: Site, reading: Reading, score: float) -> Passage:
    """What a site joins: a crossing the arms on opposite sides, a lens those on the same side."""
    arms = site.rivals if reading is Reading.LENS else site.pairs
    first, second = (tuple((site.arms[n].strand, site.arms[n].end) for n in pair) for pair in arms)
    crossed: tuple[tuple[float, FloatArray], ...] = ((0.5, site.xy),)
    if reading is Reading.LENS and site.middle is not None:
        line = web.strands[site.middle].xy
        crossed = (0.0, line[0]), (1.0, line[-1])
    return Passage(site.middle, ((first[0], first[1]), (second[0], second[1])), score, crossed)


def _many_arms(web: Web, knot: int, ends: list[End]) -> tuple[Passage | None, int]:
    """At a joint of five arms or more the smoothest pairs pass through that turn by no more than
    a right angle, while three arms or none are left."""
    arms = [measure_arm(web, s, e) for s, e in ends]
    left = list(range(len(arms)))
    pairs: list[tuple[End, End]] = []
    while len(left) > 3:
        turn, i, j = min(
            (bend(arms[i], arms[j]), i, j) for n, i in enumerate(left) for j in left[n + 1 :]
        )
        if turn > np.pi / 2:
            break
        pairs.append((ends[i], ends[j]))
        left = [k for k in left if k not in (i, j)]
    if len(left) == 2:
        pairs.append((ends[left[0]], ends[left[1]]))
        left = []
    if not pairs:
        return None, len(left)
    return Passage(None, tuple(pairs), 0.5, ((0.5, web.knots_xy[knot]),)), len(left)


def _touched(
    web: Web, knot: int, ends: list[End], depths: Sequence[Surface]
) -> tuple[Passage | None, int]:
    """A joint of three arms of which one only is upon, or under, the strand of the others; or all
    three left."""
    if not depths:
        return None, len(ends)
    arms = [measure_arm(web, s, e) for s, e in ends]
    found = touching(depths, web, arms)
    if found is None:
        return None, len(ends)
    stem, score = found
    pairs, place = ((ends[stem - 1], ends[stem - 2]),), ((0.5, web.knots_xy[knot]),)
    return Passage(None, pairs, score, place, (ends[stem],)), 0


def _branch_score(
    knot: int,
    sites: list[Site],
    scores: FloatArray,
    web: Web,
    graph: Graph,
    predictions: Predictions,
) -> float:
    """Probability of a branch-point: what is left after the sites that the joint could be part of,
    together with the probability that the network gives for the nodes nearby."""
    rival = max(
        (
            1 - float(p[Reading.BRANCH_POINTS])
            for s, p in zip(sites, scores, strict=True)
            if knot in s.knots
        ),
        default=0.0,
    )
    away = np.hypot(*(graph.xy - web.knots_xy[knot]).T)
    near = away <= max(graph.spacing, float(away.min()))
    return (1 - rival) * (0.5 + 0.5 * float(predictions.classes[near, 0].max()))
