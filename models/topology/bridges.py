"""Where a strand may go on over a gap of the mask, and the evidence for it (thesis 6.6.1,
extended).

Strategy: every free end looks ahead. What it sees on other strands, a free end that faces it, a
joint that lacks an arm, or a side, is a proposal; two ends that face one another with a strand
between them propose a crossing. A small network turns the evidence of a proposal into a
probability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.directions import unit
from models.geometry.polylines import arc_lengths, intersections, point_at
from models.geometry.sampling import read_nearest
from models.strands.ends import in_view, width_of
from models.strands.graph import degrees
from models.topology.classifiers import chain_links, links_of
from models.topology.graph import Graph
from models.topology.scene import Predictions
from models.topology.sites import Arm, bend, ends_at, least_bend, measure_arm

_LONG = 12.0
"""Widths; a strand that is longer counts no more."""
_REACH_WIDTHS = 3.2
_REACH_PX = 14.0
"""How far an end looks ahead: so many widths, and pixels for what a thin strand loses at a gap."""
_LOOK_WIDTHS, _LOOK_PX = np.array([0.4, 1.6, 1.8, 3.4]), np.array([0, 2, 2, 4])
_LOOK_SHARES = np.array([0.2, 0.6, 0.6, 1.0])
"""Where behind its tip an end is looked at: from the first place to the second for its direction,
from the third to the last for how it turns; on a short strand at most at these shares of it."""
_CONE = np.cos(np.deg2rad(65))
"""Of its heading, what an end looks at; two ends face one another that are in each other's cone."""
_OWN_NODES = 6
"""Nodes of the end's own strand that are too near to be what it goes on to."""
_MOST_TARGETS = 4


@dataclass(frozen=True, eq=False)
class End:
    """A free end: its knot, its strand, the direction it points in, how it turns (radians a px),
    and its width."""

    knot: int
    strand: int
    xy: FloatArray
    heading: FloatArray
    curvature: float
    width: float
    length: float


@dataclass(frozen=True, eq=False)
class Bridge:
    """``nodes``: of the graph, to be joined in this order, a free end first; ``evidence``:
    ``(21,)``."""

    nodes: tuple[int, ...]
    evidence: BridgeEvidence


def free_ends(graph: Graph) -> list[End]:
    """Ends in view, not at the picture's border."""
    count = degrees(graph.web)
    ends = []
    for k, strand in enumerate(graph.web.strands):
        for knot in {strand.a, strand.b}:
            if count[knot] != 1:
                continue
            seen = strand.seen_from(knot)
            if in_view(seen.xy[0], graph.distances.shape, float(seen.radii[0])):
                ends.append(_end(knot, k, seen.xy, seen.radii))
    return ends


def _end(knot: int, strand: int, xy: FloatArray, radii: FloatArray) -> End:
    """Strategy: the outermost half width of a medial line follows the shape of the tip; what is
    behind it shows it."""
    lengths = arc_lengths(xy)
    total = float(lengths[-1])
    width = max(2.0, width_of(radii))
    at = np.minimum(_LOOK_WIDTHS * width + _LOOK_PX, _LOOK_SHARES * total)
    outer, middle, again, inner = point_at(xy, lengths, at)
    near, far = unit(outer - middle), unit(again - inner)
    turn = float(np.arctan2(far[0] * near[1] - far[1] * near[0], far @ near))
    away = max(float(at[2] + at[3] - at[0] - at[1]) / 2, 1e-6)
    return End(
        knot,
        strand,
        xy[0],
        near,
        float(np.clip(turn / away, -0.5 / width, 0.5 / width)),
        width,
        total,
    )


def proposals(graph: Graph, predictions: Predictions) -> list[Bridge]:
    """All bridges worth weighing."""
    ends = {e.knot: e for e in free_ends(graph)}
    if not ends:
        return []
    view = _View(graph, predictions, ends)
    found = []
    for end in ends.values():
        found += [
            Bridge((end.knot, there), _evidence(view, end, there, None))
            for there in _ahead(view, end)
        ]
    return found + _through(view)


class _View:
    """What every proposal needs to look up."""

    def __init__(self, graph: Graph, predictions: Predictions, ends: dict[int, End]) -> None:
        self.graph, self.predictions, self.ends = graph, predictions, ends
        count = len(graph.xy)
        self.owners: list[list[tuple[int, int]]] = [[] for _ in range(count)]
        for k, chain in enumerate(graph.chains):
            for place, node in enumerate(chain.tolist()):
                self.owners[node].append((k, place))
        self.at = ends_at(graph.web)
        self.segments: IntArray = graph.edges[:, graph.traced]
        self.knots = list(ends)
        self.tree = cKDTree(np.stack([e.xy for e in ends.values()]))
        self.reach = _REACH_PX + _REACH_WIDTHS * (
            float(graph.radii.max()) + max(e.width for e in ends.values())
        )
        self.nearest = {knot: self._nearest(e) for knot, e in ends.items()}
        self.loose, self.traced = (
            links_of(graph, predictions, which) for which in (~graph.traced, graph.traced)
        )

    def link(self, end: End, there: int) -> float:
        """The most probable link from the end to a node or its neighbors on a strand."""
        near = {there}
        for k, place in self.owners[there]:
            near |= set(self.graph.chains[k][max(0, place - 1) : place + 2].tolist())
        pairs = ((min(end.knot, n), max(end.knot, n)) for n in near)
        return max((self.loose.get(p, 0.0) for p in pairs), default=0.0)

    def near(self, end: End) -> list[End]:
        """The other free ends that any bridge could reach."""
        found = self.tree.query_ball_point(end.xy, self.reach, return_sorted=True)
        return [self.ends[self.knots[k]] for k in found if self.knots[k] != end.knot]

    def _nearest(self, end: End) -> int:
        """The free end nearest to another that is ahead of it, or -1."""
        others = [e for e in self.near(end) if (e.xy - end.xy) @ end.heading > 0]
        return min(others, key=lambda e: float(np.hypot(*(e.xy - end.xy)))).knot if others else -1

    def own(self, end: End, node: int) -> bool:
        """Whether a node is on the end's own strand, within a few nodes of it."""
        chain = self.graph.chains[end.strand]
        places = [
            p if chain[0] == end.knot else len(chain) - 1 - p
            for k, p in self.owners[node]
            if k == end.strand
        ]
        return any(p < _OWN_NODES for p in places)


def _ahead(view: _View, end: End) -> list[int]:
    """The nodes that the end may go on to: of every strand ahead the one that is most nearly
    ahead; what is at a right angle counts twice as far."""
    graph = view.graph
    step = graph.xy - end.xy
    size = np.hypot(*step.T)
    reach = _REACH_WIDTHS * end.width + _REACH_PX + graph.radii
    cosine = unit(step) @ end.heading
    cost = size * (2 - cosine) - graph.radii
    best: dict[int, tuple[float, int]] = {}
    for node in np.flatnonzero((size < reach) & (cosine > _CONE) & (size > 0)).tolist():
        if view.own(end, node) or (
            node in view.ends and _between(view, end, view.ends[node]) is not None
        ):
            continue
        for k, _ in view.owners[node]:
            best[k] = min(best.get(k, (np.inf, -1)), (float(cost[node]), node))
    ranked = sorted(set(best.values()))
    return [node for _, node in ranked[:_MOST_TARGETS]]


def _through(view: _View) -> list[Bridge]:
    """Two ends that face one another over a strand: the bridge goes through the node between
    them."""
    found = []
    for end in view.ends.values():
        for other in view.near(end):
            if not _face(end, other):
                continue
            between = _between(view, end, other)
            if between is not None and _spans(view.graph, end, other, between):
                evidence = _evidence(view, end, other.knot, between)
                found.append(Bridge((end.knot, between, other.knot), evidence))
    return found


def _face(one: End, other: End) -> bool:
    step = other.xy - one.xy
    size = float(np.hypot(*step))
    cosines = float(one.heading @ step), -float(other.heading @ step)
    return one.strand != other.strand and min(cosines) > _CONE * size


def _spans(graph: Graph, one: End, other: End, between: int) -> bool:
    """Whether two ends are near enough for a bridge through a node."""
    half = (one.width + other.width) / 2
    reach = _REACH_WIDTHS * (half + float(graph.radii[between])) + _REACH_PX
    return bool(np.hypot(*(other.xy - one.xy)) <= reach)


def _between(view: _View, one: End, other: End) -> int | None:
    """The node nearest to where the line between two ends meets another strand's chain of nodes, or
    None."""
    graph = view.graph
    own = np.zeros(len(graph.xy), bool)
    own[graph.chains[one.strand]] = own[graph.chains[other.strand]] = True
    i, j = view.segments[:, ~own[view.segments].any(axis=0)]
    _, _, met = intersections((one.xy[None], other.xy[None]), (graph.xy[i], graph.xy[j]))
    if not len(met):
        return None
    place = met[np.hypot(*(met - one.xy).T).argmin()]
    nodes = np.concatenate((i, j))
    return int(nodes[np.hypot(*(graph.xy[nodes] - place).T).argmin()])


class BridgeEvidence(NamedTuple):
    """What speaks for a strand to go on over a gap: the gap in widths, in px, and up to the other
    strand's edge; the turn at either side, radians, also against the end's curvature; how the
    widths agree (log ratio); what kind of place it leads to; the share of foreground in the gap;
    what the networks give for the link and the nodes; lengths of both strands in widths, at most
    12; whether each end is the other's nearest, how sure the end's own links are, and how much the
    straightest other pair at the joint bends."""

    gap_widths: float
    gap_px: float
    apart_widths: float
    turn: float
    turn_on_curve: float
    far_turn: float
    width_change: float
    width_ratio: float
    to_end: float
    to_joint_of_three: float
    to_larger_joint: float
    along_edge: float
    covered: float
    link: float
    branch: float
    crossing: float
    length: float
    far_length: float
    mutual: float
    own_links: float
    beside: float


def _evidence(view: _View, end: End, there: int, between: int | None) -> BridgeEvidence:
    graph = view.graph
    step = graph.xy[there] - end.xy
    size = float(np.hypot(*step))
    turn, from_curve = _turns(end, step, size)
    gap, between_share = _gap(graph, end, graph.xy[there])
    far_turn, change, beside = _other_side(view, end, there)
    is_end = there in view.ends
    joint = len(view.at[there]) if there in view.at else 0
    far = view.ends.get(there)
    mutual = far is not None and there == view.nearest[end.knot] and end.knot == view.nearest[there]
    branch, cross = view.predictions.classes[there if between is None else between].tolist()
    return BridgeEvidence(
        gap_widths=gap / end.width,
        gap_px=gap,
        apart_widths=(size - float(graph.radii[there])) / end.width,
        turn=turn,
        turn_on_curve=from_curve,
        far_turn=far_turn,
        width_change=abs(change),
        width_ratio=change,
        to_end=float(is_end),
        to_joint_of_three=float(joint == 3),
        to_larger_joint=float(joint > 3),
        along_edge=float(between is not None),
        covered=between_share,
        link=view.link(end, there),
        branch=branch,
        crossing=cross,
        length=min(end.length / end.width, _LONG),
        far_length=min(far.length / far.width, _LONG) if far is not None else _LONG,
        mutual=float(mutual),
        own_links=_own_links(view, end),
        beside=beside,
    )


def _turns(end: End, step: FloatArray, size: float) -> tuple[float, float]:
    """Angle between where the end points and the bridge; and the same if the end keeps on turning
    as it does."""
    turn = float(
        np.arctan2(end.heading[0] * step[1] - end.heading[1] * step[0], end.heading @ step)
    )
    expected = end.curvature * (size / 2 + end.width)
    return abs(turn), abs(turn - expected)


def _gap(graph: Graph, end: End, there: FloatArray) -> tuple[float, float]:
    """Length of the bridge on background, px; and the share of foreground between its first and
    last background."""
    size = float(np.hypot(*(there - end.xy)))
    along = np.linspace(end.xy, there, round(size) + 2)
    empty = read_nearest(graph.distances, along) <= 0
    if not empty.any():
        return 0.0, 1.0
    places: IntArray = np.flatnonzero(empty)
    return float(empty.mean()) * size, 1 - len(places) / float(places[-1] - places[0] + 1)


def _other_side(view: _View, end: End, there: int) -> tuple[float, float, float]:
    """How much a strand would turn beyond the bridge, radians, and the logarithm of the widths'
    ratio: for a free end towards its strand, for a joint on its best arm, for a side the incidence
    (0: at a right angle). And how much the straightest other pair of a joint's arms turns: a strand
    that crosses there."""
    graph = view.graph
    here = Arm(end.strand, 0, end.knot, end.xy, -end.heading, end.width)
    if there in view.at:
        arms = [measure_arm(graph.web, k, side) for k, side in view.at[there]]
        turned = [(bend(here, a) + abs(np.log(a.width / end.width)), a) for a in arms]
        arm = min(turned, key=lambda t: t[0])[1]
        others = [a for a in arms if a is not arm]
        return bend(here, arm), float(np.log(arm.width / end.width)), least_bend(others)
    k, place = view.owners[there][0]
    chain = graph.chains[k]
    along = unit(
        graph.xy[chain[min(place + 1, len(chain) - 1)]] - graph.xy[chain[max(place - 1, 0)]]
    )
    incidence = float(np.arcsin(min(1.0, abs(float(along @ unit(graph.xy[there] - end.xy))))))
    width = width_of(graph.web.strands[k].radii)
    return incidence, float(np.log(width / end.width)), np.pi


def _own_links(view: _View, end: End) -> float:
    """Mean probability of the links of the end's own strand near the end."""
    graph = view.graph
    chain = graph.chains[end.strand]
    chain = chain if chain[0] == end.knot else chain[::-1]
    return float(np.mean(chain_links(chain[:5], view.traced)))
