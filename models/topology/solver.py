"""From the graph and what the networks say of it to the topology (thesis Algorithm 6, section 6.6).

Strategy: repair the strands; weigh every site that may be a crossing and accept the probable ones, the most probable
first, no joint twice; every other joint is a branch-point. Then walk the strands: a walk goes straight on through a
crossing and ends at a branch-point or a free end. One walk may pass a crossing twice: a self-loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import FloatArray
from models.topology.graph import Graph
from models.topology.judges import Judges, judged
from models.topology.repair import repaired
from models.topology.scene import Predictions
from models.topology.sites import Site, bend, crossing_sites, ends_at, evidence, measure_arm
from models.topology.skeleton import Web

End = tuple[int, int]
"""A strand and which of its ends: 0 or 1."""
_MOST_BEND = 1.6
"""Sections are merged only where they go on smoothly: at a joint of many arms no pair may turn more, radians."""


@dataclass(frozen=True, eq=False)
class Passage:
    """An accepted crossing: the two pairs of strand ends that it joins, and its probability."""

    site: Site
    pairs: tuple[tuple[End, End], ...]
    score: float


@dataclass(frozen=True, eq=False)
class Solution:
    """``passages``: accepted crossings; ``branches``: ``(knot, probability)`` of every branch-point."""

    web: Web
    passages: tuple[Passage, ...]
    branches: tuple[tuple[int, float], ...]


def solve(
    graph: Graph, predictions: Predictions, judges: Judges, tint: Callable[[Site], float] | None = None
) -> Solution:
    """Which joints of the graph are crossings and which are branch-points.

    ``tint``: what the picture's colors say of a site, as a difference of log odds in favor of a crossing.
    """
    web = repaired(graph, predictions, judges)
    sites = crossing_sites(web)
    scores = _scores(sites, web, graph, predictions, judges, tint)
    passages: list[Passage] = []
    taken: set[int] = set()
    for k in np.argsort(-scores, kind="stable"):
        site = sites[k]
        if scores[k] <= 0.5 or taken & set(site.knots):
            continue
        taken |= set(site.knots)
        pairs = tuple((_end(site, i), _end(site, j)) for i, j in site.pairs)
        passages.append(Passage(site, pairs, float(scores[k])))
    branches = []
    for knot, ends in ends_at(web).items():
        if knot in taken or len(ends) < 3:
            continue
        passage, left = _many_arms(web, knot, ends) if len(ends) > 4 else (None, len(ends))
        if passage is not None:
            passages.append(passage)
        if left:
            branches.append((knot, _branch_score(knot, sites, scores, web, graph, predictions)))
    return Solution(web, tuple(passages), tuple(branches))


def _scores(
    sites: list[Site], web: Web, graph: Graph, predictions: Predictions, judges: Judges,
    tint: Callable[[Site], float] | None,
) -> FloatArray:  # fmt: skip
    scores = judged(judges.crossing, [evidence(s, web, graph.xy, predictions) for s in sites])
    if tint is None or not sites:
        return scores
    odds = np.log(np.clip(scores, 1e-6, 1) / np.clip(1 - scores, 1e-6, 1)) + np.array([tint(s) for s in sites])
    return 1 / (1 + np.exp(-odds))


def _end(site: Site, arm: int) -> End:
    return site.arms[arm].strand, site.arms[arm].end


def _many_arms(web: Web, knot: int, ends: list[End]) -> tuple[Passage | None, int]:
    """At a joint of five arms or more the smoothest pairs pass through, while three arms or none are left."""
    arms = [measure_arm(web, s, e) for s, e in ends]
    left = list(range(len(arms)))
    pairs: list[tuple[End, End]] = []
    while len(left) > 3:
        turn, i, j = min((bend(arms[i], arms[j]), i, j) for n, i in enumerate(left) for j in left[n + 1 :])
        if turn > _MOST_BEND:
            break
        pairs.append((ends[i], ends[j]))
        left = [k for k in left if k not in (i, j)]
    if len(left) == 2:
        pairs.append((ends[left[0]], ends[left[1]]))
        left = []
    if not pairs:
        return None, len(left)
    xy = web.knots_xy[knot]
    site = Site((knot,), tuple(arms), None, xy, ((0, 1), (0, 1)), ((0, 1), (0, 1)))
    return Passage(site, tuple(pairs), 0.5), len(left)


def _branch_score(
    knot: int, sites: list[Site], scores: FloatArray, web: Web, graph: Graph, predictions: Predictions
) -> float:
    """Probability of a branch-point: what is left after the sites that the joint could be part of, together with
    the classifier's word on the nodes nearby."""
    rival = max((float(p) for s, p in zip(sites, scores, strict=True) if knot in s.knots), default=0.0)
    away = np.hypot(*(graph.xy - web.knots_xy[knot]).T)
    near = away <= max(graph.spacing, float(away.min()) + 1e-6)
    return (1 - rival) * (0.5 + 0.5 * float(predictions.classes[near, 0].max()))
