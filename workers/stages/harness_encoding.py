"""Topologies between contracts and arrays; ids count from 1, indices from 0."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import (
    BranchMatch,
    BranchPoint,
    DrawingMatch,
    HarnessDrawing,
    HarnessState,
    Section,
    SectionCrossing,
    SectionPlace,
    TopologyEdge,
    TopologyResult,
)

from models.geometry.polylines import arc_lengths
from models.topology import scene as found
from models.topology.harness_drawing import Match
from workers.stages.depth import curve_fields, plane
from workers.stages.encoding import as_point, as_points
from workers.stages.outcome import InvalidInput
from workers.stages.seen_harness import SeenHarness

_MESSAGES = {
    "branched": "a harness with branch-points",
    "plain": "DLOs without a branch-point",
    "closed": "only closed rings: no ends, no branch-points",
    "empty": "no DLO in the picture",
    "unsure": "most of the foreground is too wide for a DLO: its mask may be inverted, or show a "
    "surface",
    "too_complex": "the foreground falls into too many strands: this is no picture of DLOs, or its "
    "mask is noise",
}


def section_names(match: Match) -> dict[int, str]:
    """Names of the drawn branches by section index."""
    return {k: name for name, sections in match.sections.items() for k in sections}


def encode(
    seen: SeenHarness, match: Match | None = None, drawing: HarnessDrawing | None = None
) -> TopologyResult:
    """The topology as it travels: ids count from 1."""
    topology = seen.topology
    names = section_names(match) if match else {}
    places = {k: name for name, k in match.points.items()} if match else {}
    height, width = topology.size
    return TopologyResult(
        width=width,
        height=height,
        status=topology.status,
        message=_MESSAGES[topology.status],
        threshold=seen.foreground.threshold,
        nodes_xy=as_points(topology.nodes_xy),
        node_angles_rad=[round(a, 4) for a in topology.node_angles.tolist()],
        node_branch_scores=[round(p, 4) for p in topology.node_classes[:, 0].tolist()],
        node_crossing_scores=[round(p, 4) for p in topology.node_classes[:, 1].tolist()],
        edges=_edges(topology),
        sections=[_section(k, seen, names.get(k)) for k in range(len(topology.sections))],
        branch_points=_branch_points(topology, places),
        crossings=_crossings(topology),
        match=None
        if match is None or drawing is None
        else _drawing_match(match, drawing, topology),
        reference=seen.foreground.references,
        table=plane(seen.depth),
        warnings=seen.remarks,
        models=seen.models,
    )


def _edges(topology: found.Topology) -> list[TopologyEdge]:
    links = zip(topology.links.tolist(), topology.link_scores.tolist(), strict=True)
    return [TopologyEdge(a=a, b=b, score=round(score, 4)) for (a, b), score in links]


def _branch_points(topology: found.Topology, names: dict[int, str]) -> list[BranchPoint]:
    return [
        BranchPoint(
            id=k + 1,
            xy=as_point(b.xy),
            sections=[s + 1 for s in b.sections],
            score=round(b.score, 4),
            name=names.get(k),
        )
        for k, b in enumerate(topology.branch_points)
    ]


def _crossings(topology: found.Topology) -> list[SectionCrossing]:
    return [
        SectionCrossing(
            id=k,
            xy=as_point(c.xy),
            over=_place(c.over),
            under=_place(c.under),
            score=round(c.score, 4),
            order_score=round(c.order_score, 4),
        )
        for k, c in enumerate(topology.crossings, start=1)
    ]


def _covered(k: int, topology: found.Topology) -> list[tuple[float, float]]:
    """Where a section is under another strand, in shares of its length."""
    stretches = []
    for crossing in topology.crossings:
        if crossing.under.section == k:
            half = (
                0.75
                * topology.sections[crossing.over.section].width
                / max(topology.sections[k].length, 1e-9)
            )
            stretches.append((crossing.under.u - half, crossing.under.u + half))
    return stretches


def _section(k: int, seen: SeenHarness, name: str | None) -> Section:
    section = seen.topology.sections[k]
    first, last = ((b + 1 if b >= 0 else None) for b in section.branches)
    return Section(
        id=k + 1,
        points_xy=as_points(section.xy),
        width_px=round(section.width, 2),
        length_px=round(section.length, 2),
        end_widths_px=(round(section.end_widths[0], 2), round(section.end_widths[1], 2)),
        ends=section.ends,
        branch_points=(first, last),
        closed=section.closed,
        score=round(section.score, 4),
        name=name,
        **curve_fields(
            seen.depth, section.xy, section.width, _covered(k, seen.topology), len(section.xy)
        ),
    )


def _drawing_match(match: Match, drawing: HarnessDrawing, topology: found.Topology) -> DrawingMatch:
    scale = match.scale or 0.0
    return DrawingMatch(
        branches=[
            BranchMatch(
                name=b.name,
                sections=[k + 1 for k in match.sections[b.name]],
                length_px=round(
                    sum(topology.sections[k].length for k in match.sections[b.name]), 2
                ),
                expected_px=round(scale * b.length, 2),
                cost=round(match.costs[b.name], 4),
            )
            for b in drawing.branches
            if b.name in match.sections
        ],
        missing=list(match.missing),
        extra=[k + 1 for k in match.extra],
        px_per_unit=match.scale,
        scale_from="request" if drawing.px_per_unit else "estimate",
        ambiguous=match.ambiguous,
        cost=round(match.cost, 4),
    )


def _place(place: found.Place) -> SectionPlace:
    return SectionPlace(section=place.section + 1, u=round(min(1.0, max(0.0, place.u)), 4))


def decode(state: HarnessState, field: str = "topology") -> found.Topology:
    """A topology as it travels to one to compute with: indices count from 0. Raises InvalidInput
    naming the request's ``field``."""
    sections = []
    for s in state.sections:
        xy = np.array(s.points_xy, dtype=np.float64)
        first, last = ((b - 1 if b is not None else -1) for b in s.branch_points)
        length = float(arc_lengths(xy)[-1])
        if length <= 0:
            raise InvalidInput(
                f"{field}.sections", f"section {s.id} has no length", "invalid_topology"
            )
        sections.append(
            found.Section(xy, s.width_px, length, s.ends, (first, last), s.closed, s.score)
        )
    branches = [
        found.BranchPoint(b.xy, tuple(k - 1 for k in b.sections), b.score)
        for b in state.branch_points
    ]
    crossings = [
        found.Crossing(
            c.xy, _decoded_place(c.over), _decoded_place(c.under), c.score, c.order_score
        )
        for c in state.crossings
    ]
    none = np.zeros(0)
    return found.Topology(
        (state.height, state.width),
        "branched" if branches else "plain",
        tuple(sections),
        tuple(branches),
        tuple(crossings),
        np.zeros((0, 2)),
        none,
        np.zeros((0, 2)),
        np.zeros((0, 2), np.int64),
        none,
    )


def _decoded_place(place: SectionPlace) -> found.Place:
    return found.Place(place.section - 1, place.u)
