"""The web by what the networks give: stubs are taken off and gaps are bridged (thesis 6.6.1,
extended)."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.polylines import intersections, segments
from models.strands.graph import Strand, Web, compact, contract, dissolve
from models.topology.bridges import proposals
from models.topology.classifiers import Classifiers, probabilities_of
from models.topology.graph import Graph, without
from models.topology.scene import Predictions
from models.topology.stubs import candidates

_LEAST = 0.5
"""Bridges that are less probable are not built; shorter strands that are less probable are taken
off."""


def repaired(graph: Graph, predictions: Predictions, classifiers: Classifiers) -> Web:
    """The strands that are part of a DLO, with gaps of the mask bridged; knots of two strands are
    dissolved."""
    real = pruned(graph, predictions, classifiers)
    bridges = _bridges(real, predictions, classifiers)
    web = _bridged(real, bridges) if bridges else real.web
    return compact(contract(dissolve(web)))


def pruned(graph: Graph, predictions: Predictions, classifiers: Classifiers) -> Graph:
    """The graph without short strands that are no part of a DLO: what they cover of an end comes
    free."""
    found = candidates(graph, predictions)
    scores = probabilities_of(classifiers.stub, [c.evidence for c in found])
    dropped = {c.strand for c, p in zip(found, scores.tolist(), strict=True) if p < _LEAST}
    return without(graph, dropped) if dropped else graph


def _bridges(
    graph: Graph, predictions: Predictions, classifiers: Classifiers
) -> list[tuple[int, int]]:
    """Pairs of nodes to join, the most probable first, every free end once."""
    proposed = proposals(graph, predictions)
    scores = _both_ways(
        [b.nodes for b in proposed],
        probabilities_of(classifiers.bridge, [b.evidence for b in proposed]),
    )
    ends = {b.nodes[0] for b in proposed}
    taken: set[int] = set()
    chosen: list[tuple[int, int]] = []
    for k in np.argsort(-scores, kind="stable").tolist():
        nodes = proposed[k].nodes
        if scores[k] > _LEAST and not taken & set(nodes):
            taken |= ends & set(nodes)
            chosen += list(pairwise(nodes))
    return chosen


def _both_ways(nodes: list[tuple[int, ...]], scores: FloatArray) -> FloatArray:
    """Two free ends propose the same bridge: the mean of both probabilities."""
    of = dict(zip(nodes, scores.tolist(), strict=True))
    return np.array([(p + of.get(n[::-1], p)) / 2 for n, p in of.items()])


def _bridged(graph: Graph, bridges: list[tuple[int, int]]) -> Web:
    """The web with one more strand a bridge; strands are split where a bridge meets their side or
    crosses them."""
    strands = list(graph.web.strands)
    knots = list(graph.web.knots_xy)
    cuts: dict[int, list[tuple[int, int]]] = defaultdict(list)
    owner = {int(n): k for k, chain in enumerate(graph.chains) for n in chain[1:-1]}
    knot_of: dict[int, int] = {}

    def cut(k: int, xy: FloatArray) -> int:
        """A new knot at the point of a strand that is nearest to ``xy``."""
        knots.append(xy)
        cuts[k].append((_nearest(strands[k], xy), len(knots) - 1))
        return len(knots) - 1

    for node in sorted({n for pair in bridges for n in pair}):
        knot_of[node] = cut(owner[node], graph.xy[node]) if node in owner else node
    for here, there in bridges:
        strands.append(_straight(graph, here, there, (knot_of[here], knot_of[there])))
        for k, xy in _crossed(strands[:-1], strands[-1]):
            cuts[len(strands) - 1].append((_nearest(strands[-1], xy), cut(k, xy)))
    return Web(
        np.array(knots),
        tuple(part for k, strand in enumerate(strands) for part in _split(strand, cuts[k])),
    )


def _nearest(strand: Strand, xy: FloatArray) -> int:
    return int(np.hypot(*(strand.xy - xy).T).argmin())


def _straight(graph: Graph, here: int, there: int, knots: tuple[int, int]) -> Strand:
    """The strand that a bridge between two nodes adds."""
    steps = max(2, round(float(np.hypot(*(graph.xy[there] - graph.xy[here])))))
    radii = np.linspace(graph.radii[here], min(graph.radii[here], graph.radii[there]), steps) + 0.5
    return Strand(*knots, np.linspace(graph.xy[here], graph.xy[there], steps), radii)


def _crossed(strands: list[Strand], bridge: Strand) -> list[tuple[int, FloatArray]]:
    """The strands that a bridge crosses, and where; within the half width of its ends it may touch
    what it leads to."""
    parts = segments(tuple((k, s.xy) for k, s in enumerate(strands)))
    _, j, xy = intersections((bridge.xy[:1], bridge.xy[-1:]), (parts[0], parts[1]))
    owners = parts[2][j].astype(int).tolist()
    return [
        (k, place)
        for k, place in zip(owners, xy, strict=True)
        if all(np.hypot(*(place - bridge.xy[e])) > bridge.radii[e] + 1 for e in (0, -1))
    ]


def _split(strand: Strand, cuts: list[tuple[int, int]]) -> list[Strand]:
    """The strand cut at some of its points, which become knots: ``(point, knot)``."""
    places = [0, *(place for place, _ in sorted(cuts)), len(strand.xy) - 1]
    knots = [strand.a, *(knot for _, knot in sorted(cuts)), strand.b]
    return [
        Strand(knots[k], knots[k + 1], strand.xy[a : b + 1], strand.radii[a : b + 1])
        for k, (a, b) in enumerate(pairwise(places))
        if b > a
    ]
