"""The steps of Ariadne+ in order (thesis Fig. 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.geometry.directions import quarter_turned, tangents
from models.geometry.polylines import arc_lengths, around
from models.geometry.sampling import read_nearest
from models.instances.assembly import Order, assemble
from models.instances.crossings import Meeting, Strand, order_meetings, ordered
from models.instances.published.ariadne_plus.patches import (
    CROSSING_PIXELS,
    NODE_PIXELS,
    AboveNetwork,
    EmbeddingNetwork,
    only,
    patch,
    reduction,
    to_network,
)
from models.instances.published.ariadne_plus.paths import (
    Appearance,
    find_paths,
    intersection_scores,
)
from models.instances.published.ariadne_plus.superpixels import Regions, region_graph
from models.instances.scene import Crossing, Scene
from models.instances.working_size import at_working_size
from models.strands.chain import Chain
from models.strands.foreground import distance_map
from models.strands.stopwatch import Stopwatch

_MAX_PIXELS = 700_000
_SPACING_PX = 4.0
"""Larger masks are reduced, as SLIC takes long; points of a path are so far apart before they are
centered."""

Network = EmbeddingNetwork | AboveNetwork


@dataclass(frozen=True)
class AriadnePlusParams:
    """``superpixels``: how many the foreground is cut into (thesis 3.6.5: 50); fewer where they
    would be smaller than a DLO is wide."""

    superpixels: int = 50


def extract(
    mask: BoolArray,
    image: ByteArray | None = None,
    params: AriadnePlusParams | None = None,
    networks: Sequence[Network] = (),
) -> Scene:
    """The DLOs of a foreground mask.

    ``mask``: ``(H, W)``. ``image``: ``(H, W, 3)`` RGB or None. ``networks``: TripletNet and
    CrossNet; without them, or without an image, the curvature alone scores intersections and the
    color's variance decides who is on top.

    Any mask is allowed, and the work is bounded: beyond 0.7 megapixels the mask is reduced; an
    intersection of more than 24 branches keeps 24. Raises ``ValueError`` when the image is of
    another size than the mask.
    """
    settings = params or AriadnePlusParams()
    return at_working_size(
        mask, image, lambda m, i: _extract(m, i, settings, networks), _MAX_PIXELS
    )


def _extract(
    mask: BoolArray, image: ByteArray | None, params: AriadnePlusParams, networks: Sequence[Network]
) -> Scene:
    watch = Stopwatch()
    with watch.step("superpixels"):
        distances = distance_map(mask)
        width = 4 * float(distances.sum()) / max(int(np.count_nonzero(mask)), 1)
        regions = region_graph(mask, image, params.superpixels, width)
    with watch.step("scores"):
        appearance = (
            _appearance(regions, distances, image, networks[0])
            if networks and image is not None
            else None
        )
        scores = intersection_scores(regions, appearance)
    with watch.step("paths"):
        paths = find_paths(regions, scores)
        chains = [
            c for path, ring in paths if (c := _chain(path, ring, regions, distances)) is not None
        ]
    order = _layout(networks[1]) if networks and image is not None else order_meetings
    return assemble(chains, mask, distances, image, watch, method="ariadne_plus", order=order)


def _appearance(
    regions: Regions, distances: Float32Array, image: ByteArray, network: EmbeddingNetwork
) -> Appearance:
    """TripletNet's squared distances between the patches around nodes; one batch for all
    intersections' neighbors."""
    wanted = sorted(
        {n for k in np.flatnonzero(regions.is_intersection).tolist() for n in regions.neighbors[k]}
    )
    if not wanted:
        return lambda nodes: np.zeros((len(nodes), len(nodes)))
    widths = 2 * read_nearest(distances, regions.xy[wanted])
    patches = [
        patch(image, regions.xy[n], NODE_PIXELS, reduction(float(w)))
        for n, w in zip(wanted, widths, strict=True)
    ]
    row = {node: k for k, node in enumerate(wanted)}
    embedded = network(to_network(patches)).astype(np.float64)

    def between(nodes: list[int]) -> FloatArray:
        mine = embedded[[row[n] for n in nodes]]
        apart = mine[:, None] - mine[None]
        out: FloatArray = np.einsum("ijk,ijk->ij", apart, apart)
        return out

    return between


def _chain(path: list[int], ring: bool, regions: Regions, distances: Float32Array) -> Chain | None:
    """The path's centroids as points every few pixels, moved onto the middle of the foreground.

    Beyond the thesis: a curve through centroids of long superpixels leaves the middle of a bent
    DLO, and an intersection's centroid belongs to all DLOs there, so no curve is led through it.
    """
    points = regions.xy[[node for node in path if not regions.is_intersection[node]]]
    if not ring:
        first, last = regions.tips[path[0]], regions.tips[path[-1]]
        points = np.concatenate((first[None], points, last[None]))
    points = points[np.concatenate(([True], np.hypot(*np.diff(points, axis=0).T) > 1.0))]
    if len(points) < 2:
        return None
    closed = np.concatenate((points, points[:1])) if ring else points
    lengths = arc_lengths(closed)
    places = np.linspace(0, lengths[-1], max(4, round(float(lengths[-1]) / _SPACING_PX)))
    dense = PchipInterpolator(lengths, closed)(places)
    settled = _settled(dense, distances)
    return Chain(settled[:-1] if ring else settled, ring)


def _settled(points: FloatArray, distances: Float32Array) -> FloatArray:
    """Every point moved across the curve to the largest distance from the background, then
    smoothed."""
    normal = quarter_turned(tangents(points))
    reach = max(2.0, 1.5 * float(np.median(read_nearest(distances, points))))
    offsets = np.linspace(-reach, reach, 13)
    ahead = points[:, None] + offsets[None, :, None] * normal[:, None]
    height = read_nearest(distances, ahead) - 0.02 * np.abs(offsets)
    shift = offsets[height.argmax(axis=1)]
    padded = np.pad(shift, 2, mode="edge")
    shift = np.median(np.stack([padded[k : k + len(shift)] for k in range(5)]), axis=0)
    out: FloatArray = points + shift[:, None] * normal
    out[[0, -1]] = points[[0, -1]]
    return out


def _layout(above: AboveNetwork) -> Order:
    """Order of all crossings by CrossNet in one batch (3.3.8)."""

    def order(
        meetings: list[Meeting], strands: list[Strand], image: ByteArray | None
    ) -> tuple[Crossing, ...]:
        if not meetings or image is None:
            return order_meetings(meetings, strands, image)
        patches = [p for meeting in meetings for p in _masked(meeting, strands, image)]
        chances = above(to_network(patches)).reshape(-1, 2).astype(np.float64)
        found = []
        for meeting, (a, b) in zip(meetings, chances, strict=True):
            score = max(a, b) / max(a + b, 1e-9)
            found.append(ordered(meeting, strands, bool(a >= b), float(np.clip(score, 0.5, 1.0))))
        return tuple(found)

    return order


def _masked(meeting: Meeting, strands: list[Strand], image: ByteArray) -> list[ByteArray]:
    """The patch of the crossing, once with only the one strand and once with only the other."""
    pair = ((strands[meeting.a], meeting.at_a), (strands[meeting.b], meeting.at_b))
    step = reduction((pair[0][0].width + pair[1][0].width) / 2)
    whole = patch(image, meeting.xy, CROSSING_PIXELS, step)
    patches = []
    for strand, at in pair:
        line = around(strand.xy, at / strand.lengths[-1], CROSSING_PIXELS * step)
        patches.append(
            only(whole, (line - meeting.xy) / step + (CROSSING_PIXELS - 1) / 2, strand.width / step)
        )
    return patches
