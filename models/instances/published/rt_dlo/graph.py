"""From a foreground mask to a graph along the DLOs (thesis 3.5.2 and 3.5.3).

Symbols: V vertices, K neighbors a vertex, E = V * K candidate edges, each from a vertex to its
neighbor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.sampling import farthest_points, local_maxima, read_nearest, thin_to_grid
from models.instances.published.rt_dlo.orientation import (
    OrientationNetwork,
    angles_from_scores,
    principal_angles,
    read_patches,
)

_MAX_MAXIMA = 12_000
_MAX_VERTICES = 2_000
"""Bounds of the work: farthest-point sampling takes their product in time."""


@dataclass(frozen=True, eq=False)
class Vertices:
    """What is known at each of V places along the DLOs.

    ``xy``: ``(V, 2)`` pixels; ``radii``: ``(V,)`` half widths; ``directions``: ``(V, 2)`` unit
    vectors, their sign is free; ``colors``: ``(V, 3)`` RGB, all 0 without a picture.
    """

    xy: FloatArray
    radii: FloatArray
    directions: FloatArray
    colors: FloatArray

    @cached_property
    def typical_radius(self) -> float:
        return float(np.median(self.radii))


def sample_vertices(
    distances: Float32Array,
    image: ByteArray | None,
    sampling_ratio: float,
    network: OrientationNetwork | None,
) -> Vertices:
    """Local maxima of the distance transform, thinned by farthest-point sampling, with their
    orientation.

    At most 12 000 maxima are looked at and 2 000 vertices kept, whatever the mask.
    """
    maxima = thin_to_grid(local_maxima(distances), _MAX_MAXIMA)
    count = min(int(np.ceil(sampling_ratio * len(maxima))), _MAX_VERTICES)
    if count < 2:
        return Vertices(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)))
    pixels = maxima[farthest_points(maxima, count)]
    radii = np.maximum(distances[pixels[:, 1], pixels[:, 0]].astype(np.float64) - 0.5, 0.5)
    inner = ~_is_bump(pixels, radii)
    pixels, radii = pixels[inner], radii[inner]
    xy = pixels.astype(np.float64)
    patches = read_patches(distances, xy, np.maximum(radii, np.median(radii)))
    angles = principal_angles(patches) if network is None else angles_from_scores(network(patches))
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    colors = (
        np.zeros((len(xy), 3))
        if image is None
        else image[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    )
    return Vertices(xy, radii, directions, colors)


def _is_bump(pixels: IntArray, radii: FloatArray) -> BoolArray:
    """``(V,)`` True for maxima that only an uneven outline makes: beside one more than twice as
    thick."""
    lengths, others = cKDTree(pixels).query(pixels, min(6, len(pixels)))
    covered = (lengths < 1.5 * radii[others]) & (radii[:, None] < 0.5 * radii[others])
    out: BoolArray = covered.any(axis=1)
    return out


def select_edges(
    vertices: Vertices, mask: BoolArray, neighbors: int, min_similarity: float
) -> IntArray:
    """``(m, 2)`` undirected edges ``a < b``: the positive and negative edge of every vertex (thesis
    3.5.3).

    Strategy: eq. 3.5's ``V x E`` matrix has two entries a column, one for the edge's source (+1 in
    the incidence matrix) and one for its target (-1). They are kept as two vectors of length E, and
    every row-wise minimum, maximum and argmax becomes one over the entries grouped by that row's
    vertex. The target's entry has its sign turned, so that the negative edge, too, is the one with
    the highest score.

    Beyond the thesis, an edge must run on the foreground: gaps are for :func:`join_paths`, which
    sees whole strands on both sides.
    """
    count = len(vertices.xy)
    k = min(neighbors, count - 1)
    lengths, targets = (
        np.asarray(a)[:, 1:].ravel() for a in cKDTree(vertices.xy).query(vertices.xy, k + 1)
    )
    sources = np.repeat(np.arange(count), k)
    along = (vertices.xy[targets] - vertices.xy[sources]) / lengths[:, None]
    source_cosines = _dots(vertices.directions[sources], along)
    target_cosines = _dots(vertices.directions[targets], along)
    vertex_similarity = np.abs(_dots(vertices.directions[sources], vertices.directions[targets]))
    # Half way, an edge between strands side by side is off the foreground.
    on_mask = read_nearest(mask, (vertices.xy[sources] + vertices.xy[targets]) / 2)
    chosen = []
    for rows, scores in ((sources, source_cosines), (targets, target_cosines)):
        weighted = scores * vertex_similarity * _length_weights(rows, lengths, count) * on_mask
        chosen.append(_best_per_row(rows, weighted, min_similarity))
    kept = np.concatenate(chosen)
    first, second = (
        np.minimum(sources[kept], targets[kept]),
        np.maximum(sources[kept], targets[kept]),
    )
    return np.stack(np.divmod(np.unique(first * count + second), count), axis=1)


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    out: FloatArray = np.einsum("ij,ij->i", a, b)
    return out


def _length_weights(rows: IntArray, lengths: FloatArray, count: int) -> FloatArray:
    """``w = 1 - (d - min d) / max d`` over the edges of the same row (thesis 3.5.3)."""
    shortest, longest = np.full(count, np.inf), np.zeros(count)
    np.minimum.at(shortest, rows, lengths)
    np.maximum.at(longest, rows, lengths)
    out: FloatArray = 1 - (lengths - shortest[rows]) / longest[rows]
    return out


def _best_per_row(rows: IntArray, scores: FloatArray, above: float) -> IntArray:
    """Index of the highest-scoring edge of each row, of those above the threshold."""
    able = np.flatnonzero(scores > above)
    order = able[np.lexsort((-scores[able], rows[able]))]
    _, first = np.unique(rows[order], return_index=True)
    return order[first]
