"""``topology``: picture, or foreground mask, to the topology of the harnesses in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import (
    BranchMatch,
    BranchPoint,
    DisentangleRequest,
    DrawingMatch,
    HarnessDrawing,
    ModelUsed,
    Point,
    Section,
    SectionCrossing,
    SectionPlace,
    TopologyEdge,
    TopologyRequest,
    TopologyResult,
)
from numpy.typing import NDArray

from models.segmentation.segment import foreground_mask
from models.strands.stopwatch import Stopwatch
from models.topology import scene as found
from models.topology.classifiers import JUDGES, Judges
from models.topology.extraction import extract
from models.topology.harness_drawing import Drawn, Match, match_drawing
from models.topology.order import Surface, depth_map, points
from models.topology.overlay import overlay
from models.weights.inference import Network, default_name
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.pictures import png, read_depth_m, read_mask, read_rgb
from workers.stages.segment import foreground, mask_png, model_used

MASK_THRESHOLD = 0.5
_ABOVE_ZERO = 1e-6
_MESSAGES = {
    "branched": "a harness with branch-points",
    "plain": "DLOs without a branch-point",
    "closed": "only closed rings: no ends, no branch-points",
    "empty": "no DLO in the picture",
    "unsure": "most of the foreground is too wide for a DLO: its mask may be inverted, or show a surface",
    "too_complex": "the foreground falls into too many strands: this is no picture of DLOs, or its mask is noise",
}


@dataclass(frozen=True)
class Seen:
    """What was seen: ``ground`` is the picture to draw on."""

    topology: found.Topology
    probability: NDArray[np.float32]
    threshold: float
    ground: NDArray[np.uint8]
    models: list[ModelUsed]


def run(request: TopologyRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    seen = see(request, tools, watch)
    tools.progress(0.8)
    match = None
    if request.drawing is not None:
        with watch.step("match"):
            match = _match(seen.topology, request.drawing)
    with watch.step("encode"):
        result = encode(seen, match, request.drawing)
        files = {}
        if "overlay" in request.files:
            names = _names(match) if match else None
            files["overlay.png"] = ("image/png", png(overlay(seen.ground, seen.topology, names)))
        if "mask" in request.files:
            files["mask.png"] = ("image/png", mask_png(seen.probability))
    steps = {f"topology.{name}": ms for name, ms in seen.topology.timings_ms.items()}
    return Outcome(result, files, watch.timings_ms | steps)


def see(request: TopologyRequest | DisentangleRequest, tools: Tools, watch: Stopwatch) -> Seen:
    """Decode, find the foreground, extract the topology."""
    with watch.step("decode"):
        image = read_rgb(request.image, "image", tools) if request.image is not None else None
        mask = read_mask(request.mask, "mask", tools) if request.mask is not None else None
        surfaces = _surfaces(request, image, mask, tools)
    tools.progress(0.1)
    models: list[ModelUsed] = []
    with watch.step("segment"):
        if mask is not None:
            probability, applied = mask, MASK_THRESHOLD if request.threshold is None else request.threshold
            cable = probability >= max(applied, _ABOVE_ZERO)
        elif image is not None:
            spec, settings, probability = foreground(image, request.model, tools)
            applied = settings.threshold if request.threshold is None else request.threshold
            cable = foreground_mask(probability, settings, request.threshold)
            models.append(model_used(spec))
        else:
            raise InvalidInput("image", "an image or a mask is needed")
    network, judges = networks(tools)
    models += [model_used(n.spec) for n in (network, *judges)]
    with watch.step("topology"):
        topology = extract(cable, network, Judges(*judges), image, surfaces)
    ground = image if image is not None else _gray(probability)
    return Seen(topology, probability, applied, ground, models)


def networks(tools: Tools) -> tuple[Network, list[Network]]:
    """The graph's network, and those that judge single places, in the order of :class:`Judges`."""
    return tools.network(default_name("topology")), [tools.network(default_name(task)) for task in JUDGES]


def _surfaces(
    request: TopologyRequest | DisentangleRequest, image: NDArray[np.uint8] | None, mask: NDArray[np.float32] | None,
    tools: Tools,
) -> list[Surface]:  # fmt: skip
    """Depth and points; everything must be of one size."""
    sizes = {"image": image.shape[:2] if image is not None else None, "mask": mask.shape if mask is not None else None}
    surfaces = []
    if request.depth is not None:
        depth = read_depth_m(request.depth, "depth", tools)
        sizes["depth"] = depth.shape
        surfaces.append(depth_map(depth))
    given = {name: size for name, size in sizes.items() if size is not None}
    first, size = next(iter(given.items()), ("image", None))
    for name, other in given.items():
        if other != size:
            (h, w), (oh, ow) = given[first], other
            raise InvalidInput(name, f"is {ow} × {oh} while the {first} is {w} × {h}", "size_mismatch")
    if request.points:
        xy = np.array([p.xy for p in request.points])
        surfaces.append(points(xy, np.array([p.depth_m for p in request.points])))
    return surfaces


def _gray(probability: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.repeat(np.rint(probability * 160).astype(np.uint8)[:, :, None], 3, axis=2)


def _match(topology: found.Topology, drawing: HarnessDrawing) -> Match:
    branches = [Drawn(b.name, b.a, b.b, b.length) for b in drawing.branches]
    return match_drawing(topology, branches, drawing.connectors, drawing.px_per_unit)


def _names(match: Match) -> dict[int, str]:
    """Names of the drawn branches by section index."""
    return {k: name for name, sections in match.sections.items() for k in sections}


def encode(seen: Seen, match: Match | None = None, drawing: HarnessDrawing | None = None) -> TopologyResult:
    """The topology as it travels: ids count from 1."""
    topology = seen.topology
    names = _names(match) if match else {}
    places = {k: name for name, k in match.points.items()} if match else {}
    height, width = topology.size
    return TopologyResult(
        width=width,
        height=height,
        status=topology.status,
        message=_MESSAGES[topology.status],
        threshold=seen.threshold,
        nodes_xy=_points(topology.nodes_xy),
        node_angles_rad=[round(a, 4) for a in topology.node_angles.tolist()],
        node_branch_scores=[round(p, 4) for p in topology.node_classes[:, 0].tolist()],
        node_crossing_scores=[round(p, 4) for p in topology.node_classes[:, 1].tolist()],
        edges=[
            TopologyEdge(a=a, b=b, score=round(score, 4))
            for (a, b), score in zip(topology.links.tolist(), topology.link_scores.tolist(), strict=True)
        ],
        sections=[_section(k, s, names.get(k)) for k, s in enumerate(topology.sections)],
        branch_points=[
            BranchPoint(id=k + 1, xy=_point(b.xy), sections=[s + 1 for s in b.sections], score=round(b.score, 4),
                        name=places.get(k))
            for k, b in enumerate(topology.branch_points)
        ],
        crossings=[
            SectionCrossing(id=k, xy=_point(c.xy), over=_place(c.over), under=_place(c.under),
                            score=round(c.score, 4), order_score=round(c.order_score, 4))
            for k, c in enumerate(topology.crossings, start=1)
        ],
        match=None if match is None or drawing is None else _drawing_match(match, drawing, topology),
        models=seen.models,
    )  # fmt: skip


def _section(k: int, section: found.Section, name: str | None) -> Section:
    first, last = ((b + 1 if b >= 0 else None) for b in section.branches)
    return Section(
        id=k + 1,
        points_xy=_points(section.xy),
        width_px=round(section.width, 2),
        length_px=round(section.length, 2),
        end_widths_px=(round(section.end_widths[0], 2), round(section.end_widths[1], 2)),
        ends=section.ends,
        branch_points=(first, last),
        closed=section.closed,
        score=round(section.score, 4),
        name=name,
    )


def _drawing_match(match: Match, drawing: HarnessDrawing, topology: found.Topology) -> DrawingMatch:
    scale = match.scale or 0.0
    return DrawingMatch(
        branches=[
            BranchMatch(
                name=b.name,
                sections=[k + 1 for k in match.sections[b.name]],
                length_px=round(sum(topology.sections[k].length for k in match.sections[b.name]), 2),
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


def _point(xy: tuple[float, float]) -> Point:
    return round(float(xy[0]), 2), round(float(xy[1]), 2)


def _points(xy: NDArray[np.float64]) -> list[Point]:
    return [(x, y) for x, y in np.round(xy, 2).tolist()]
