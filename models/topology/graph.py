"""Graph initialization: nodes of constant density along the strands, and candidate edges (thesis
6.4).

Symbols: N nodes, E undirected candidate edges ``(i, j)`` with ``i < j``. The first K nodes are the
web's knots.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from models.geometry.polylines import arc_lengths, point_at
from models.geometry.sampling import read_nearest
from models.strands.cleaning import clean
from models.strands.graph import Strand, Web, cleaned, web_of
from models.strands.pixel_graph import trace

NEIGHBORS = 8
"""K_nn of thesis 6.4.3."""
_SPACING_WIDTHS = 1.1
_LEAST_SPACING_PX = 8.0
"""Between nodes: about a typical width, so that windows around neighbors overlap; not less, for
thin strands."""
_MAX_NODES = 2_000
_MAX_STRANDS = 800
_HOLE_WIDTHS, _SLIT_WIDTHS = 0.2, 0.25
"""Holes that no strand could pass, see :func:`clean`."""


class TooComplexError(ValueError):
    """The mask is no picture of DLOs: its skeleton has more strands than any harness."""


@dataclass(frozen=True, eq=False)
class Graph:
    """What is known before anything is learned.

    ``xy``: ``(N, 2)``; ``radii``: ``(N,)`` half widths; ``spacing`` px between neighbors;
    ``edges``: ``(2, E)``; ``traced``: ``(E,)`` bool, the nodes are neighbors on a strand;
    ``chains``: for each strand of ``web`` its nodes in order, both knots included; ``distances``:
    ``(H, W)``.
    """

    xy: FloatArray
    radii: FloatArray
    spacing: float
    edges: IntArray
    traced: BoolArray
    chains: tuple[IntArray, ...]
    web: Web
    distances: Float32Array


def initialize(mask: BoolArray) -> Graph:
    """The graph of ``(H, W)`` foreground. Raises TooComplexError for masks of noise.

    Nodes lie on the medial lines, evenly: their density is the same for every mask by construction,
    while thinning the maxima of the distance transform (6.4.2) leaves it to chance.
    """
    foreground = clean(mask, _HOLE_WIDTHS, _SLIT_WIDTHS)
    raw = web_of(trace(foreground), foreground.distances)
    if len(raw.strands) > 5 * _MAX_STRANDS:
        raise TooComplexError(f"{len(raw.strands)} strands")
    web = cleaned(raw)
    if len(web.strands) > _MAX_STRANDS:
        raise TooComplexError(f"{len(web.strands)} strands")
    return sample(web, foreground.distances)


def sample(web: Web, distances: Float32Array) -> Graph:
    """Nodes along the strands of the web, and edges: the 8 nearest and the neighbors on a
    strand."""
    spacing = _spacing(web)
    xy = [web.knots_xy]
    chains = []
    count = len(web.knots_xy)
    for strand in web.strands:
        lengths = arc_lengths(strand.xy)
        steps = max(2 if strand.a == strand.b else 1, round(lengths[-1] / spacing))
        inner = point_at(strand.xy, lengths, lengths[-1] * np.arange(1, steps) / steps)
        chains.append(np.array([strand.a, *range(count, count + len(inner)), strand.b]))
        xy.append(inner)
        count += len(inner)
    nodes = np.concatenate(xy)
    edges, traced = _edges(nodes, chains)
    radii = np.maximum(read_nearest(distances, nodes) - 0.5, 0.5)
    return Graph(nodes, radii, spacing, edges, traced, tuple(chains), web, distances)


def without(graph: Graph, dropped: set[int]) -> Graph:
    """The graph without some of its strands; strands that then meet two by two are one. Nodes and
    edges stay."""
    pairs = [
        (s, c)
        for k, (s, c) in enumerate(zip(graph.web.strands, graph.chains, strict=True))
        if k not in dropped
    ]
    at: dict[int, list[tuple[Strand, IntArray]]] = defaultdict(list)
    for pair in pairs:
        at[pair[0].a].append(pair)
        at[pair[0].b].append(pair)
    for knot in {k for n in dropped for k in (graph.web.strands[n].a, graph.web.strands[n].b)}:
        if len(at[knot]) != 2 or at[knot][0] is at[knot][1]:
            continue
        (before, first), (after, second) = (_seen_from(knot, *p) for p in at[knot])
        joined = (before.reversed().followed_by(after), np.concatenate((first[::-1], second[1:])))
        for end in (before.b, after.b):
            at[end] = [p for p in at[end] if all(p is not q for q in at[knot])] + [joined]
        at[knot] = []
    kept = list({id(s): (s, c) for found in at.values() for s, c in found}.values())
    web = Web(graph.web.knots_xy, tuple(s for s, _ in kept))
    chains = [c for _, c in kept]
    traced = np.isin(
        graph.edges[0] * len(graph.xy) + graph.edges[1], _keys_along(chains, len(graph.xy))
    )
    return replace(graph, web=web, chains=tuple(chains), traced=traced)


def _seen_from(knot: int, strand: Strand, chain: IntArray) -> tuple[Strand, IntArray]:
    return (strand, chain) if strand.a == knot else (strand.reversed(), chain[::-1])


def _spacing(web: Web) -> float:
    if not web.strands:
        return _LEAST_SPACING_PX
    radii = np.concatenate([s.radii for s in web.strands])
    length = sum(s.length for s in web.strands)
    wanted = max(_LEAST_SPACING_PX, _SPACING_WIDTHS * (2 * float(np.median(radii)) - 1))
    return max(wanted, length / (_MAX_NODES - len(web.knots_xy)))


def _edges(xy: FloatArray, chains: list[IntArray]) -> tuple[IntArray, BoolArray]:
    count = len(xy)
    if count < 2:
        return np.zeros((2, 0), np.int64), np.zeros(0, bool)
    _, nearest = cKDTree(xy).query(xy, min(NEIGHBORS + 1, count))
    near = np.stack((np.repeat(np.arange(count), nearest.shape[1]), nearest.ravel()))
    keys_along = _keys_along(chains, count)
    keys = np.unique(np.concatenate((np.minimum(*near) * count + np.maximum(*near), keys_along)))
    first, second = np.divmod(keys, count)
    proper = first != second
    return np.stack((first, second))[:, proper].astype(np.int64), np.isin(keys, keys_along)[proper]


def _keys_along(chains: list[IntArray], count: int) -> IntArray:
    """A number for every pair of neighbors on a chain."""
    along = np.concatenate(
        [np.zeros((2, 0), np.int64), *(np.stack((c[:-1], c[1:])) for c in chains)], axis=1
    )
    return np.unique(np.minimum(*along) * count + np.maximum(*along))
