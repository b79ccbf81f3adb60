"""Short strands that may be no part of a DLO: a clip, a burr, a corner of a connector; or a rung,
where two strands touch or a clip spans them (thesis 6.6.1, extended)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.directions import angle_between
from models.strands.ends import width_of
from models.strands.graph import Strand, degrees, protrusion
from models.topology.classifiers import Links, chain_links, links_of
from models.topology.graph import Graph
from models.topology.scene import Predictions
from models.topology.sites import Arm, bend, ends_at, least_bend, measure_arm

_LONGEST = 8.0
"""In radii of the joint: what reaches farther is a branch; a rung in own radii, between the discs
of its joints."""
_FAR, _FAR_BORDER = 40.0, 8.0
"""Radii; a sibling, or the picture's border, that is farther away counts no more."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """``strand`` of the graph's web; ``tip``: the knot at its free end, -1 for a rung."""

    strand: int
    tip: int
    evidence: StubEvidence


@dataclass(frozen=True, eq=False)
class _Side:
    """What the strand looks like at one of its joints: the angle to the nearest other arm, its
    least bend into one, the least bend between two others, how many arms there are, widths of the
    others, length of the shortest other strand that ends freely."""

    nearest: float
    least_bend: float
    through: float
    arms: int
    widths: FloatArray
    sibling: float


def candidates(graph: Graph, predictions: Predictions) -> list[Candidate]:
    """Every short strand that leaves a joint and ends freely, or at another joint."""
    count = degrees(graph.web)
    links = links_of(graph, predictions, graph.traced)
    looked = _Arms(graph)
    found = []
    for k, strand in enumerate(graph.web.strands):
        joints = [j for j in (strand.a, strand.b) if count[j] > 2]
        if not joints or strand.a == strand.b or not _is_short(strand, joints):
            continue
        tip = next((t for t in (strand.a, strand.b) if count[t] == 1), -1)
        if tip >= 0 or len(joints) == 2:
            found.append(Candidate(k, tip, _evidence(graph, predictions, links, looked, k, joints)))
    return found


def _is_short(strand: Strand, joints: list[int]) -> bool:
    if len(joints) == 1:
        return protrusion(strand, joints[0]) < _LONGEST * float(
            strand.seen_from(joints[0]).radii[0]
        )
    return _exposed(strand) < _LONGEST * float(strand.radii.min())


def _exposed(strand: Strand) -> float:
    return strand.length - float(strand.radii[0]) - float(strand.radii[-1])


class _Arms:
    """The arms at joints, measured once."""

    def __init__(self, graph: Graph) -> None:
        self._web = graph.web
        self._count = degrees(graph.web)
        self._ends = ends_at(graph.web)
        self._known: dict[int, list[Arm]] = {}

    def side(self, joint: int, k: int) -> _Side:
        """Strand ``k`` as it leaves a joint."""
        if joint not in self._known:
            self._known[joint] = [measure_arm(self._web, n, side) for n, side in self._ends[joint]]
        arms = self._known[joint]
        own = next(a for a in arms if a.strand == k)
        others = [a for a in arms if a is not own]
        strands = [self._web.strands[a.strand] for a in others]
        free = [s.length for s in strands if self._count[s.b if s.a == joint else s.a] == 1]
        return _Side(
            min(float(angle_between(own.heading, a.heading)) for a in others),
            min(bend(own, a) for a in others),
            least_bend(others),
            len(arms),
            np.array([a.width for a in others]),
            min(free, default=np.inf),
        )


class StubEvidence(NamedTuple):
    """What speaks for a short strand to be a branch: how far it reaches beyond the joint's disc and
    how wide it is, in radii of the disc, own widths, and against the other arms; what the networks
    give for its links; how it leaves the joint and how straight the others run on without it,
    radians, at the worse of two joints; the nearest strand like it and the picture's border, in
    radii; what the networks give for the nodes at its joints and along it; whether it is a rung
    between two joints."""

    reach_radii: float
    reach_widths: float
    length_widths: float
    width_radii: float
    width_to_widest: float
    width_to_narrowest: float
    tip_radii: float
    mean_link: float
    least_link: float
    last_link: float
    opening: float
    least_bend: float
    bend_without: float
    arms: float
    sibling: float
    border: float
    joint_branch: float
    joint_crossing: float
    own_branch: float
    own_crossing: float
    rung: float


def _evidence(
    graph: Graph, predictions: Predictions, links: Links, looked: _Arms, k: int, joints: list[int]
) -> StubEvidence:
    strand = graph.web.strands[k].seen_from(joints[0])
    sides = [looked.side(j, k) for j in joints]
    rung = len(joints) == 2
    radius = float(strand.radii[0])
    out = _exposed(strand) if rung else protrusion(strand, joints[0])
    own = width_of(strand.radii[strand.radii.argmin(), None] if rung else strand.radii)
    widths = np.concatenate([s.widths for s in sides])
    chain = graph.chains[k]
    believed = chain_links(chain, links)
    last = believed[0] if chain[0] not in joints else believed[-1]
    height, across = graph.distances.shape
    x, y = strand.xy[-1]
    border = min(x, y, across - 1 - x, height - 1 - y) / max(float(strand.radii[-1]), 1.0)
    sibling = min(min(s.sibling for s in sides) / radius, _FAR)
    joint_branch, joint_crossing = predictions.classes[joints].max(axis=0).tolist()
    own_branch, own_crossing = predictions.classes[chain].max(axis=0).tolist()
    return StubEvidence(
        reach_radii=out / radius,
        reach_widths=out / own,
        length_widths=strand.length / own,
        width_radii=own / radius,
        width_to_widest=own / float(widths.max()),
        width_to_narrowest=own / float(widths.min()),
        tip_radii=float(strand.radii[-1]) / radius,
        mean_link=float(np.mean(believed)),
        least_link=float(np.min(believed)),
        last_link=last,
        opening=min(s.nearest for s in sides),
        least_bend=min(s.least_bend for s in sides),
        bend_without=max(s.through for s in sides),
        arms=float(max(s.arms for s in sides)),
        sibling=sibling,
        border=min(border, _FAR_BORDER),
        joint_branch=joint_branch,
        joint_crossing=joint_crossing,
        own_branch=own_branch,
        own_crossing=own_crossing,
        rung=float(rung),
    )
