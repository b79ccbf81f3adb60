"""The web after the networks have spoken: stubs are taken off and gaps are bridged (thesis 6.6.1, extended)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from models.geometry.arrays import FloatArray
from models.topology.bridges import proposals
from models.topology.graph import Graph, without
from models.topology.judges import Judges, judged
from models.topology.scene import Predictions
from models.topology.skeleton import Strand, Web
from models.topology.stubs import candidates
from models.topology.web import compact, contract, dissolve

_LEAST = 0.5
"""Bridges that are less probable are not built; shorter strands that are less probable are taken off."""


def repaired(graph: Graph, predictions: Predictions, judges: Judges) -> Web:
    """The strands that are part of a DLO, with gaps of the mask bridged; knots of two strands are dissolved."""
    real = pruned(graph, predictions, judges)
    bridges = _bridges(real, predictions, judges)
    web = _bridged(real, bridges) if bridges else real.web
    return compact(contract(dissolve(web)))


def pruned(graph: Graph, predictions: Predictions, judges: Judges) -> Graph:
    """The graph without short strands that are no part of a DLO: what they cover of an end comes free."""
    found = candidates(graph, predictions)
    scores = judged(judges.stub, [c.evidence for c in found])
    dropped = {c.strand for c, p in zip(found, scores.tolist(), strict=True) if p < _LEAST}
    return without(graph, dropped) if dropped else graph


def _bridges(graph: Graph, predictions: Predictions, judges: Judges) -> list[tuple[int, int]]:
    """Pairs of nodes to join, the most probable first, every free end once."""
    proposed = proposals(graph, predictions)
    scores = _both_ways([b.nodes for b in proposed], judged(judges.bridge, [b.evidence for b in proposed]))
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
    """Two free ends see each other: the mean of what either says."""
    of = dict(zip(nodes, scores.tolist(), strict=True))
    return np.array([(p + of.get(n[::-1], p)) / 2 for n, p in of.items()])


def _bridged(graph: Graph, bridges: list[tuple[int, int]]) -> Web:
    """The web with one more strand a bridge; strands are split where a bridge meets their side."""
    knots = graph.web.knots_xy
    cuts: dict[int, list[int]] = {}
    owner = {int(n): k for k, chain in enumerate(graph.chains) for n in chain[1:-1]}
    knot_of: dict[int, int] = {}
    for node in {n for pair in bridges for n in pair}:
        if node in owner:
            cuts.setdefault(owner[node], []).append(node)
            knot_of[node] = len(knots) + len(knot_of)
    added = np.array([graph.xy[n] for n in knot_of]).reshape(-1, 2)
    strands: list[Strand] = []
    for k, strand in enumerate(graph.web.strands):
        strands += _split(strand, graph.xy, cuts[k], knot_of) if k in cuts else [strand]
    for here, there in bridges:
        line = np.linspace(
            graph.xy[here], graph.xy[there], max(2, round(float(np.hypot(*(graph.xy[there] - graph.xy[here])))))
        )
        radii = np.linspace(graph.radii[here], min(graph.radii[here], graph.radii[there]), len(line)) + 0.5
        strands.append(Strand(knot_of.get(here, here), knot_of.get(there, there), line, radii))
    return Web(np.concatenate((knots, added)), tuple(strands))


def _split(strand: Strand, nodes_xy: FloatArray, nodes: list[int], knot_of: dict[int, int]) -> list[Strand]:
    """The strand cut at some of its inner nodes."""
    places = sorted((int(np.hypot(*(strand.xy - nodes_xy[n]).T).argmin()), n) for n in nodes)
    bounds = [0, *(p for p, _ in places), len(strand.xy) - 1]
    knots = [strand.a, *(knot_of[n] for _, n in places), strand.b]
    return [
        Strand(knots[k], knots[k + 1], strand.xy[bounds[k] : bounds[k + 1] + 1],
               strand.radii[bounds[k] : bounds[k + 1] + 1])
        for k in range(len(bounds) - 1) if bounds[k + 1] > bounds[k]
    ]  # fmt: skip
