"""What the networks see of nodes and edges (thesis 6.5.2), read only where nodes are.

The thesis convolves the whole distance transform and then reads it at the nodes; here the same two
convolutions see a window of it around each node, scaled by the nodes' spacing. Absolute positions
(its F_P) are left out: the place of a harness in the picture is no part of its topology. An edge's
direction is periodic over 180 degrees; its first three harmonics stand in for the 180 values of a
Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray, IntArray
from models.geometry.sampling import read_nearest
from models.strands.ends import in_view
from models.topology.graph import Graph

PATCH = 16
"""Samples of a node's window along each side."""
NODE_FEATURES = 5
EDGE_FEATURES = 12
_WINDOW = 3.2
"""Width of a node's window in spacings."""
_SAMPLES = 9
"""Places along an edge where the mask is read."""


@dataclass(frozen=True, eq=False)
class Encoded:
    """``patches``: ``(N, 16, 16)`` distances in spacings; ``nodes``: ``(N, 5)``; ``edges``: ``(2,
    E)`` int64; ``edge_features``: ``(E, 12)``; all float32 but ``edges``."""

    patches: Float32Array
    nodes: Float32Array
    edges: IntArray
    edge_features: Float32Array


def encode(graph: Graph) -> Encoded:
    """The networks' inputs for one graph."""
    return Encoded(_patches(graph), _node_features(graph), graph.edges, _edge_features(graph))


def _patches(graph: Graph) -> Float32Array:
    steps = (np.arange(PATCH) - (PATCH - 1) / 2) * (_WINDOW * graph.spacing / PATCH)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1)
    values = _read_inside(graph.distances, graph.xy[:, None, None] + grid)
    return (values / graph.spacing).astype(np.float32)


def _read_inside(distances: Float32Array, places: FloatArray) -> FloatArray:
    """Distances at the nearest pixels; 0 outside the picture."""
    limit = np.array(distances.shape[::-1]) - 0.5
    inside = np.all((places >= -0.5) & (places < limit), axis=-1)
    return np.where(inside, read_nearest(distances, places), 0.0)


def _node_features(graph: Graph) -> Float32Array:
    count = np.bincount(graph.edges[:, graph.traced].ravel(), minlength=len(graph.xy))
    features = np.stack(
        (
            graph.radii / graph.spacing,
            count == 1,
            count == 2,
            count > 2,
            ~in_view(graph.xy, graph.distances.shape, graph.radii[:, None]),
        ),
        axis=1,
    )
    return features.astype(np.float32)


def _edge_features(graph: Graph) -> Float32Array:
    start, end = graph.xy[graph.edges[0]], graph.xy[graph.edges[1]]
    step = end - start
    norm = np.hypot(*step.T)
    doubled = 2 * np.arctan2(step[:, 1], step[:, 0])
    turns = np.stack([f(k * doubled) for k in (1, 2, 3) for f in (np.cos, np.sin)], axis=1)
    along = start[:, None] + np.linspace(0, 1, _SAMPLES)[:, None] * step[:, None]
    depth = read_nearest(graph.distances, along)
    tail, tail_share = _tails(graph)
    features = np.column_stack(
        (
            norm / graph.spacing,
            turns,
            (depth > 0).mean(axis=1),
            depth.min(axis=1, initial=0.0) / graph.spacing,
            graph.traced,
            tail[graph.edges].max(axis=0) * graph.traced,
            tail_share[graph.edges].max(axis=0) * graph.traced,
        )
    )
    return features.astype(np.float32)


def _tails(graph: Graph) -> tuple[FloatArray, FloatArray]:
    """For nodes on strands with a free end: 1, and the strand's length in spacings, squashed to 0
    to 1."""
    knots = np.bincount(
        np.concatenate([c[[0, -1]] for c in graph.chains] or [np.zeros(0, np.int64)])
    )
    tail, length = np.zeros(len(graph.xy)), np.zeros(len(graph.xy))
    for strand, chain in zip(graph.web.strands, graph.chains, strict=True):
        if min(knots[strand.a], knots[strand.b]) == 1:
            tip = chain[1:] if knots[strand.a] > 1 else chain[:-1]
            tail[tip], length[tip] = 1.0, np.exp(-strand.length / (4 * graph.spacing))
    return tail, length
