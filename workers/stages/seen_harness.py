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
from workers.stages.encoding import model_used
from workers.stages.foreground import Foreground, Source, check_size, find_foreground, read_source
from workers.stages.outcome import Tools
from workers.stages.pictures import read_depth_m


@dataclass(frozen=True)
class SeenHarness:
    """``remarks`` are about the pictures that were sent."""

    topology: Topology
    foreground: Foreground
    models: list[ModelUsed]
    remarks: list[str]


def see_harness(request: TopologyRequest | DisentangleRequest, tools: Tools, watch: Stopwatch) -> SeenHarness:
    """Decode, find the foreground, extract the topology. Raises InvalidInput naming the field."""
    with watch.step("decode"):
        source = read_source(request, tools)
        surfaces = _surfaces(request, source, tools)
    tools.progress(0.1)
    with watch.step("segment"):
        foreground = find_foreground(source, tools, request, request.threshold)
    network, classifiers = topology_networks(tools)
    models = [*foreground.models, *(model_used(n.spec) for n in (network, *classifiers))]
    with watch.step("topology"):
        topology = extract(foreground.cable, network, Classifiers(*classifiers), source.image, surfaces)
    return SeenHarness(topology, foreground, models, source.remarks)


def topology_networks(tools: Tools) -> tuple[Network, list[Network]]:
    """The graph's network, and those that classifier single places, in the order of :class:`Classifiers`."""
    return tools.network(default_name("topology")), [
        tools.network(default_name(task)).weighing(columns) for task, columns in FEATURES.items()
    ]


def _surfaces(request: TopologyRequest | DisentangleRequest, source: Source, tools: Tools) -> list[Surface]:
    """Depth, which is of the picture's size, and points."""
    surfaces = []
    if request.depth is not None:
        depth = read_depth_m(request.depth, "depth", tools)
        check_size("depth", depth.shape, "picture", source.size)
        surfaces.append(depth_map(depth))
    if request.points:
        xy = np.array([p.xy for p in request.points])
        surfaces.append(points(xy, np.array([p.depth_m for p in request.points])))
    return surfaces
