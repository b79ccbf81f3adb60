"""The steps of thesis chapter 6 in order: mask to topology."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.sampling import at_scale
from models.strands.resolution import reduced
from models.strands.stopwatch import Stopwatch
from models.topology.classifiers import Classifiers
from models.topology.encodings import encode
from models.topology.graph import Graph, TooComplexError, initialize
from models.topology.order import Surface, ordered, picture
from models.topology.scene import Predictions, Status, Topology
from models.topology.sections import (
    branch_points_of,
    crossings_of,
    final_links,
    sections_of,
    walk_all,
)
from models.topology.sites import Site
from models.topology.solver import solve

MAX_PIXELS = 1_500_000
_SURFACE_PX = 1_000
"""Where nothing is found and more foreground than this was left out, the mask may show a surface,
no DLOs."""


class TopologyNetwork(Protocol):
    """Patches, node features, edges and edge features to links, orientations and classes
    (probabilities)."""

    def run(self, *inputs: NDArray) -> tuple[NDArray, ...]: ...


def extract(
    mask: BoolArray,
    network: TopologyNetwork,
    classifiers: Classifiers,
    image: ByteArray | None = None,
    surfaces: Sequence[Surface] = (),
) -> Topology:
    """The topology of the DLOs and harnesses in a mask.

    ``mask``: ``(H, W)``; ``image``: ``(H, W, 3)`` RGB or None: its colors help to tell crossings
    from branch-points and show which strand is on top; ``surfaces``: further things seen (depth),
    in the pixels of ``mask``.

    Any mask is allowed: above 1.5 megapixels it is reduced; noise gives the status ``too_complex``
    and an empty answer. Raises ValueError when the image is of another size than the mask.
    """
    binary = np.ascontiguousarray(mask, dtype=bool)
    small = reduced(binary, image, MAX_PIXELS)
    if small is None:
        return _extract(binary, network, classifiers, image, surfaces)
    seen = [replace(s, read=_scaled(s.read, small.scale)) for s in surfaces]
    found = _extract(small.mask, network, classifiers, small.image, seen).at_scale(small.scale)
    return replace(found, size=(mask.shape[0], mask.shape[1]))


def predict(graph: Graph, network: TopologyNetwork) -> Predictions:
    """Probabilities of the links, orientations and classes of a graph's nodes."""
    if not len(graph.xy):
        return Predictions(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    encoded = encode(graph)
    links, orientations, classes = network.run(
        encoded.patches, encoded.nodes, encoded.edges, encoded.edge_features
    )
    angles = np.deg2rad(np.argmax(orientations, axis=1).astype(np.float64))
    return Predictions(links.astype(np.float64), angles, classes.astype(np.float64))


def _extract(
    mask: BoolArray,
    network: TopologyNetwork,
    classifiers: Classifiers,
    image: ByteArray | None,
    surfaces: Sequence[Surface],
) -> Topology:
    watch = Stopwatch()
    try:
        with watch.step("graph"):
            graph = initialize(mask)
    except TooComplexError:
        return _nothing(mask.shape, "too_complex", watch.timings_ms)
    if not graph.web.strands:
        left_out = np.count_nonzero(mask) - np.count_nonzero(graph.distances)
        return _nothing(
            mask.shape, "unsure" if left_out > _SURFACE_PX else "empty", watch.timings_ms
        )
    with watch.step("networks"):
        predictions = predict(graph, network)
    with watch.step("solver"):
        depths = [s for s in surfaces if s.is_depth]
        solution = solve(
            graph, predictions, classifiers, None if image is None else _tint(image), depths
        )
        walks = walk_all(solution)
        sections = sections_of(walks, solution, graph)
    with watch.step("output"):
        seen = [*([] if image is None else [picture(image)]), *surfaces]
        crossings = ordered(crossings_of(walks, solution), sections, seen)
        branches = branch_points_of(solution, sections)
        links, scores = final_links(walks, graph, predictions)
        closed = all(s.closed for s in sections)
        status: Status = "branched" if branches else "closed" if closed else "plain"
    return Topology(
        (mask.shape[0], mask.shape[1]),
        status if sections else "empty",
        tuple(sections),
        tuple(branches),
        tuple(crossings),
        graph.xy,
        predictions.angles,
        predictions.classes,
        links,
        scores,
        watch.timings_ms,
    )


def _nothing(shape: tuple[int, ...], status: Status, timings: dict[str, float]) -> Topology:
    return Topology(
        (shape[0], shape[1]),
        status,
        (),
        (),
        (),
        np.zeros((0, 2)),
        np.zeros(0),
        np.zeros((0, 2)),
        np.zeros((0, 2), np.int64),
        np.zeros(0),
        timings,
    )


_COLOR_UNIT = 25.0
"""Gray levels by which the colors of two strands must differ to be two colors."""
_COLOR_WEIGHT = 1.5
"""Log odds that colors can add at most."""


def _tint(image: ByteArray) -> Callable[[Site], float]:
    """Colors at a site as log odds for a crossing: its pairs should look alike, more than the other
    way to pair."""
    seen = picture(image)

    def odds(site: Site) -> float:
        colors = []
        for arm in site.arms:
            along = arm.xy + np.arange(0.5, 3, 0.5)[:, None] * arm.width * arm.heading
            colors.append(np.median(seen.read(along), axis=0))
        alike = [sum(_apart(colors, i, j) for i, j in pairs) for pairs in (site.pairs, site.rivals)]
        return _COLOR_WEIGHT * float(np.tanh((alike[1] - alike[0]) / _COLOR_UNIT))

    return odds


def _apart(colors: list[FloatArray], i: int, j: int) -> float:
    return float(np.sqrt(np.mean((colors[i] - colors[j]) ** 2)))


def _scaled(
    read: Callable[[FloatArray], FloatArray], scale: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    return lambda places: read(at_scale(places, scale))
