"""The steps of RT-DLO in order (thesis Fig. 3.13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray
from models.instances.assembly import assemble
from models.instances.published.rt_dlo.graph import sample_vertices, select_edges
from models.instances.published.rt_dlo.intersections import graph_of, resolve_intersections
from models.instances.published.rt_dlo.orientation import OrientationNetwork
from models.instances.published.rt_dlo.paths import extract_paths, join_paths, split_at_kinks
from models.instances.scene import Scene
from models.instances.working_size import at_working_size
from models.strands.chain import Chain
from models.strands.foreground import distance_map
from models.strands.stopwatch import Stopwatch


@dataclass(frozen=True)
class RtDloParams:
    """Defaults: thesis Table 3.5 for alpha (``sampling_ratio``) and K_nn (``neighbors``).

    ``min_similarity`` is mu of section 3.5.3, "a small threshold" without a number there.
    """

    sampling_ratio: float = 0.15
    neighbors: int = 8
    min_similarity: float = 0.1


def extract(
    mask: BoolArray,
    image: ByteArray | None = None,
    params: RtDloParams | None = None,
    networks: Sequence[OrientationNetwork] = (),
) -> Scene:
    """The DLOs of a foreground mask.

    ``mask``: ``(H, W)``. ``image``: ``(H, W, 3)`` RGB or None; it decides the order at crossings
    and helps to tell strands apart there. ``networks``: that of 3.5.2; without it, orientations are
    the main axes of the same patches.

    Any mask is allowed, and the work is bounded: beyond 4 megapixels the mask is reduced, at most
    12 000 maxima become 2 000 vertices, 400 paths and 255 instances. Raises ``ValueError`` when the
    image is of another size than the mask.
    """
    settings = params or RtDloParams()
    return at_working_size(
        mask, image, lambda m, i: _extract(m, i, settings, networks[0] if networks else None)
    )


def _extract(
    mask: BoolArray,
    image: ByteArray | None,
    params: RtDloParams,
    orientations: OrientationNetwork | None,
) -> Scene:
    watch = Stopwatch()
    with watch.step("vertices"):
        distances = distance_map(mask)
        vertices = sample_vertices(distances, image, params.sampling_ratio, orientations)
    if len(vertices.xy) < 2:
        return Scene((), (), np.zeros(mask.shape, np.uint8), watch.timings_ms)
    with watch.step("edges"):
        edges = select_edges(vertices, mask, params.neighbors, params.min_similarity)
    with watch.step("paths"):
        graph = resolve_intersections(graph_of(edges.tolist()), vertices)
        cut = [split_at_kinks(path, vertices) for path in extract_paths(graph)]
        paths = join_paths(cut, vertices, mask)
        chains = [Chain(vertices.xy[list(p.vertices)], p.closed) for p in paths]
    return assemble(chains, mask, distances, image, watch, method="rt_dlo")
