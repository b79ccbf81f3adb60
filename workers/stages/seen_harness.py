"""Picture or mask to topology, on arrays: what ``topology`` and ``plan_disentangle`` share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import DisentangleRequest, ModelUsed, TopologyRequest

from models.strands.stopwatch import Stopwatch
from models.topology.classifiers import Classifiers
from models.topology.evidence import FEATURES
from models.topology.extraction import extract
from models.topology.order import Surface, depth_map, points
from models.topology.scene import Topology
from models.weights.inference import Network, default_name
from workers.stages.depth import SeenDepth, read_depth
from workers.stages.encoding import model_used
from workers.stages.foreground import Foreground, find_foreground, read_source, settled
from workers.stages.outcome import Tools


@dataclass(frozen=True)
class SeenHarness:
    """``remarks`` are about the pictures that were sent."""

    topology: Topology
    foreground: Foreground
    models: list[ModelUsed]
    remarks: list[str]
    depth: SeenDepth | None


def see_harness(
    request: TopologyRequest | DisentangleRequest, tools: Tools, watch: Stopwatch
) -> SeenHarness:
    """Decode, find the foreground, extract the topology. Raises InvalidInput naming the field."""
    with watch.step("decode"):
        depth = read_depth(request, tools)
        source = read_source(request, tools, depth)
        surfaces = _surfaces(request, depth)
    tools.progress(0.1)
    with watch.step("segment"):
        foreground = find_foreground(source, tools, request, request.threshold, depth=depth)
        foreground = settled(foreground, source, request, request.threshold)
    network, classifiers = topology_networks(tools)
    models = [*foreground.models, *(model_used(n.spec) for n in (network, *classifiers))]
    with watch.step("topology"):
        topology = extract(
            foreground.cable, network, Classifiers(*classifiers), source.image, surfaces
        )
    return SeenHarness(topology, foreground, models, source.remarks, depth)


def topology_networks(tools: Tools) -> tuple[Network, list[Network]]:
    """The graph's network, and those that classifier single places, in the order of
    :class:`Classifiers`."""
    return tools.network(default_name("topology")), [
        tools.network(default_name(task)).weighing(columns) for task, columns in FEATURES.items()
    ]


def _surfaces(
    request: TopologyRequest | DisentangleRequest, depth: SeenDepth | None
) -> list[Surface]:
    surfaces = []
    if depth is not None:
        surfaces.append(
            depth_map(depth.depth_m, None if depth.camera is None else depth.camera.focal_px)
        )
    if request.points:
        xy = np.array([p.xy for p in request.points])
        surfaces.append(points(xy, np.array([p.depth_m for p in request.points])))
    return surfaces
