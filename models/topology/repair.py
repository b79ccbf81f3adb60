"""The web after the networks have spoken: stubs are taken off and gaps are bridged (thesis 6.6.1, extended)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths
from models.topology.graph import Graph
from models.topology.scene import Predictions
from models.topology.sites import Arm, bend, ends_at, measure_arm
from models.topology.skeleton import Strand, Web
from models.topology.web import compact, contract, degrees, dissolve, protrusion

_STUB_LINK = 0.5
"""A free strand whose links are less probable than this on average is a clip or a burr."""
_STUB_WIDTHS = 3.0
_BRIDGE_LINK = 0.35
_BRIDGE_TURN = np.deg2rad(50)
_BORDER_PX = 4.0
_GAP_WIDTHS = 2.5
_SAME_WIDTH = 0.7
"""Largest difference of the widths' logarithms of the two sides of a gap."""
_ACROSS_BEND = 1.3
"""Radians of bend that take most of the belief in a strand that goes on across another."""


@dataclass(frozen=True, eq=False)
class _End:
    """A free end: its knot, strand, the direction it points in, and its width."""

    knot: int
    strand: int
    heading: FloatArray
    width: float


def repaired(graph: Graph, predictions: Predictions) -> Web:
    """The strands that are part of a DLO, with gaps of the mask bridged; knots of two strands are dissolved."""
    bridges = _bridges(graph, predictions)
    web = _bridged(graph, bridges) if bridges else graph.web
    stubs = _stubs(graph, predictions)
    touched = {id(graph.web.strands[k]) for k in stubs}
    kept = Web(web.knots_xy, tuple(s for s in web.strands if id(s) not in touched))
    return compact(contract(dissolve(kept)))


def _link_of(graph: Graph, predictions: Predictions) -> dict[tuple[int, int], float]:
    return {(int(i), int(j)): float(p) for i, j, p in zip(*graph.edges, predictions.links, strict=True)}


def _stubs(graph: Graph, predictions: Predictions) -> list[int]:
    """Short free strands that the link predictor does not believe in."""
    links = _link_of(graph, predictions)
    count = degrees(graph.web)
    found = []
    for k, (strand, chain) in enumerate(zip(graph.web.strands, graph.chains, strict=True)):
        for joint, tip in ((strand.a, strand.b), (strand.b, strand.a)):
            if count[tip] != 1 or count[joint] < 3:
                continue
            out = protrusion(strand, joint)
            radius = float(strand.seen_from(joint).radii[0])
            pairs = zip(np.minimum(chain[:-1], chain[1:]).tolist(), np.maximum(chain[:-1], chain[1:]).tolist(),
                        strict=True)  # fmt: skip
            believed = float(np.mean([links.get(p, 0.0) for p in pairs]))
            if believed < _STUB_LINK and out < 2 * _STUB_WIDTHS * radius:
                found.append(k)
    return found


def _free_ends(graph: Graph) -> list[_End]:
    """Ends in view, not at the picture's border."""
    count = degrees(graph.web)
    height, across = graph.distances.shape
    ends = []
    for k, strand in enumerate(graph.web.strands):
        for knot in {strand.a, strand.b}:
            if count[knot] != 1:
                continue
            seen = strand.seen_from(knot)
            x, y = seen.xy[0]
            margin = float(seen.radii[0]) + _BORDER_PX
            if not (margin < x < across - 1 - margin and margin < y < height - 1 - margin):
                continue
            width = max(2.0, 2 * float(np.median(seen.radii)))
            inner = seen.xy[min(len(seen.xy) - 1, round(2 * width) + 3)]
            step = seen.xy[0] - inner
            ends.append(_End(knot, k, step / max(float(np.hypot(*step)), 1e-9), width))
    return ends


def _bridges(graph: Graph, predictions: Predictions) -> list[tuple[int, int]]:
    """Pairs of nodes to join: from a free end ahead to another end, or across a gap to a strand's side.

    Every free end takes the most probable node ahead of it. Two ends that face one another, and an end that faces a
    joint of which another arm leads straight on, are joined even if the link predictor hesitates.
    """
    ends = {e.knot: e for e in _free_ends(graph)}
    if not ends:
        return []
    proposals: list[tuple[float, tuple[int, ...]]] = []
    loose = ~graph.traced
    for i, j, p in zip(*graph.edges[:, loose], predictions.links[loose], strict=True):
        for here, there in ((int(i), int(j)), (int(j), int(i))):
            if here in ends:
                through = _between(graph, ends[here], ends[there]) if there in ends else None
                nodes: tuple[int, ...] = (here, there) if through is None else (here, through, there)
                proposals.append((_bridge_score(graph, ends, here, there, float(p)), nodes))
    proposals += [*_facing(graph, ends), *_across(graph, ends)]
    taken: set[int] = set()
    chosen = []
    for score, joined in sorted(proposals, reverse=True):
        if score > _BRIDGE_LINK and not taken & set(joined):
            taken |= {n for n in joined if n in ends}
            chosen += list(pairwise(joined))
    return chosen


def _bridge_score(graph: Graph, ends: dict[int, _End], here: int, there: int, link: float) -> float:
    """The link's probability, less where the bridge turns; 0 where it would turn back or double a strand."""
    end = ends[here]
    step = graph.xy[there] - graph.xy[here]
    size = float(np.hypot(*step))
    turn = float(np.arccos(np.clip(step @ end.heading / max(size, 1e-9), -1, 1)))
    if turn > _BRIDGE_TURN or _is_close_on_strand(graph, end, there):
        return 0.0
    return link * float(np.cos(turn))


def _is_close_on_strand(graph: Graph, end: _End, there: int) -> bool:
    """Whether ``there`` lies on the end's own strand, within a few nodes."""
    chain = graph.chains[end.strand].tolist()
    return there in chain and abs(chain.index(there) - chain.index(end.knot)) < 6


def _facing(graph: Graph, ends: dict[int, _End]) -> list[tuple[float, tuple[int, ...]]]:
    """Two ends that point at one another over less than two and a half widths, and the width of what lies between:
    then the bridge goes through the node there, and makes a joint of four arms."""
    found: list[tuple[float, tuple[int, ...]]] = []
    listed = list(ends.values())
    for k, one in enumerate(listed):
        for other in listed[k + 1 :]:
            start, stop = graph.xy[one.knot], graph.xy[other.knot]
            size = float(np.hypot(*(stop - start)))
            reach = _GAP_WIDTHS * min(one.width, other.width) + 6
            if one.strand == other.strand or size > 4 * reach:
                continue
            between = _between(graph, one, other)
            step = (stop - start) / max(size, 1e-9)
            cosine = float(min(one.heading @ step, -(other.heading @ step)))
            width = 0.0 if between is None else 2 * float(graph.radii[between])
            if size <= reach + 1.5 * width and cosine > 0.8:
                nodes = (one.knot, other.knot) if between is None else (one.knot, between, other.knot)
                found.append((0.9 * cosine, nodes))
    return found


def _between(graph: Graph, one: _End, other: _End) -> int | None:
    """The node of another strand that lies between two ends, or None."""
    start, stop = graph.xy[one.knot], graph.xy[other.knot]
    own = set(graph.chains[one.strand].tolist()) | set(graph.chains[other.strand].tolist())
    step = stop - start
    along = (graph.xy - start) @ step / max(float(step @ step), 1e-9)
    aside = np.hypot(*(graph.xy - start - along[:, None] * step).T)
    near = np.flatnonzero((along > 0.1) & (along < 0.9) & (aside < np.maximum(graph.radii, 0.6 * graph.spacing)))
    between = [int(n) for n in near if n not in own]
    return min(between, key=lambda n: float(aside[n])) if between else None


def _across(graph: Graph, ends: dict[int, _End]) -> list[tuple[float, tuple[int, ...]]]:
    """Ends whose strand goes on at the other side of another one: the upper strand's shadow has cut it off there.

    Seen from the end, one arm of the joint ahead leads straight on, and it is about as wide.
    """
    web = graph.web
    joints = {knot: strands for knot, strands in ends_at(web).items() if len(strands) == 3}
    found: list[tuple[float, tuple[int, ...]]] = []
    for end in ends.values():
        for knot, strands in joints.items():
            reach = float(graph.radii[knot]) + _GAP_WIDTHS * end.width + 6
            if np.hypot(*(web.knots_xy[knot] - graph.xy[end.knot])) > reach or any(s == end.strand for s, _ in strands):
                continue
            here = Arm(end.strand, 0, end.knot, graph.xy[end.knot], -end.heading, end.width)
            for strand, side in strands:
                arm = measure_arm(web, strand, side)
                if abs(np.log(arm.width / end.width)) < _SAME_WIDTH:
                    found.append((0.95 - bend(here, arm) / _ACROSS_BEND, (end.knot, knot)))
    return found


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
        strands += _split(strand, graph.chains[k], cuts[k], knot_of) if k in cuts else [strand]
    for here, there in bridges:
        line = np.linspace(
            graph.xy[here], graph.xy[there], max(2, round(float(np.hypot(*(graph.xy[there] - graph.xy[here])))))
        )
        radii = np.linspace(graph.radii[here], min(graph.radii[here], graph.radii[there]), len(line)) + 0.5
        strands.append(Strand(knot_of.get(here, here), knot_of.get(there, there), line, radii))
    return Web(np.concatenate((knots, added)), tuple(strands))


def _split(strand: Strand, chain: IntArray, nodes: list[int], knot_of: dict[int, int]) -> list[Strand]:
    """The strand cut at some of its inner nodes, which are evenly spaced along it."""
    lengths = arc_lengths(strand.xy)
    order = chain.tolist()
    places = sorted((order.index(n), n) for n in nodes)
    cuts = [int(np.searchsorted(lengths, lengths[-1] * p / (len(chain) - 1))) for p, _ in places]
    bounds = [0, *cuts, len(strand.xy) - 1]
    knots = [strand.a, *(knot_of[n] for _, n in places), strand.b]
    return [
        Strand(knots[k], knots[k + 1], strand.xy[bounds[k] : bounds[k + 1] + 1],
               strand.radii[bounds[k] : bounds[k + 1] + 1])
        for k in range(len(bounds) - 1) if bounds[k + 1] > bounds[k]
    ]  # fmt: skip
