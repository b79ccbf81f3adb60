"""The true graph of a synthetic scene: which candidate edges are links, node directions and classes
(thesis 6.5.1)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from models.synthesis.harness import FREE, Harness, HarnessParams
from models.synthesis.harness_curves import STEP_PX
from models.synthesis.harness_growth import make_harness
from models.synthesis.harness_masks import MaskParams, draw_mask
from models.topology.encodings import Encoded, encode
from models.topology.graph import Graph, initialize

_ON_LINE = 0.35
"""Within this share of a section's width of its centerline a node is that section's, whatever else
lies there."""
_ON_STRAND = 0.7


@dataclass(frozen=True, eq=False)
class Truth:
    """``links``: ``(E,)`` bool of the graph's edges; ``on``: ``(N,)`` bool, the node lies on a
    section; ``angles``: ``(N,)`` radians; ``classes``: ``(N, 2)`` bool: near a branch-point, near a
    crossing; ``pairs``: all true links, candidates or not."""

    links: BoolArray
    on: BoolArray
    angles: FloatArray
    classes: BoolArray
    pairs: frozenset[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Sample:
    """One training scene, as the networks see it."""

    truth: Truth
    encoded: Encoded


def draw_scene(
    rng: np.random.Generator, params: HarnessParams, disturbed: MaskParams
) -> tuple[Harness, Graph]:
    """A scene and its graph; scenes whose mask shows nothing are drawn again."""
    while True:
        harness = make_harness(rng, params)
        graph = initialize(draw_mask(harness, rng, disturbed))
        if graph.edges.shape[1]:
            return harness, graph


def make_sample(rng: np.random.Generator, params: HarnessParams, disturbed: MaskParams) -> Sample:
    """A scene with its truth."""
    harness, graph = draw_scene(rng, params, disturbed)
    return Sample(true_graph(harness, graph), encode(graph))


def true_graph(harness: Harness, graph: Graph) -> Truth:
    """Truth for the nodes of ``graph``: each node belongs to the nearest section, and links join
    those that follow one another on a section."""
    away, along, angles = _projections(harness, graph.xy)
    widths = np.array([s.width for s in harness.sections])[:, None]
    share = away / widths
    best = share.argmin(axis=0)
    on = away[best, np.arange(len(best))] <= _ON_STRAND * widths[best, 0] + 3
    member = (away <= _ON_LINE * widths + 1) | ((np.arange(len(widths))[:, None] == best) & on)
    hubs = _hubs(harness, graph)
    pairs: set[tuple[int, int]] = set()
    for k, section in enumerate(harness.sections):
        chain = _chain(
            np.flatnonzero(member[k]), along[k], section.ends, hubs, len(section.xy) * STEP_PX
        )
        pairs |= {(min(a, b), max(a, b)) for a, b in pairwise(chain) if a != b}
    links = np.array([(int(i), int(j)) in pairs for i, j in graph.edges.T], dtype=bool)
    return Truth(
        links,
        member.any(axis=0),
        angles[best, np.arange(len(best))],
        _classes(harness, graph),
        frozenset(pairs),
    )


def _projections(harness: Harness, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``(S, N)``: distance of each node to each section, its arc length there, and the section's
    direction."""
    away, along, angles = (np.zeros((len(harness.sections), len(xy))) for _ in range(3))
    for k, section in enumerate(harness.sections):
        away[k], nearest = cKDTree(section.xy).query(xy)
        tangents = np.gradient(section.xy, axis=0)
        step = tangents[nearest] / np.hypot(*tangents[nearest].T)[:, None]
        offset = np.sum((xy - section.xy[nearest]) * step, axis=1)
        along[k] = nearest * STEP_PX + np.clip(offset, -STEP_PX, STEP_PX)
        inner = (nearest > 0) & (nearest < len(section.xy) - 1)
        away[k] = np.where(
            inner,
            np.abs(np.sum((xy - section.xy[nearest]) * step[:, ::-1] * [-1, 1], axis=1)),
            away[k],
        )
        angles[k] = np.arctan2(step[:, 1], step[:, 0])
    return away, along, angles


def _hubs(harness: Harness, graph: Graph) -> list[int]:
    """The node that stands for each branch-point, or -1 where none is near."""
    if not len(harness.branch_xy):
        return []
    count = np.bincount(graph.edges[:, graph.traced].ravel(), minlength=len(graph.xy))
    away = np.hypot(*np.moveaxis(harness.branch_xy[:, None] - graph.xy[None], -1, 0))
    widths = np.array(
        [max(s.width for s in harness.sections if b in s.ends) for b in range(len(away))]
    )
    favored = away - np.where(count > 2, 2.5, 0.0) * widths[:, None]  # the joint, if there is one
    nearest = favored.argmin(axis=1)
    near = away[np.arange(len(away)), nearest] <= 3.0 * widths + 4
    return [int(n) if ok else FREE for n, ok in zip(nearest, near, strict=True)]


def _chain(
    nodes: IntArray, along: FloatArray, ends: tuple[int, int], hubs: list[int], length: float
) -> list[int]:
    """A section's nodes in order. Where it ends at a branch-point, that point's node comes first or
    last, and nodes beyond it belong to the other sections."""
    low, high = (hubs[e] if e != FREE else FREE for e in ends)
    first = along[low] if low != FREE else -np.inf
    last = along[high] if high != FREE else np.inf
    inner = [
        int(n)
        for n in nodes[np.argsort(along[nodes], kind="stable")]
        if first < along[n] < last and n not in (low, high)
    ]
    return [n for n in (low, *inner, high) if n != FREE]


def _classes(harness: Harness, graph: Graph) -> BoolArray:
    """``(N, 2)``: within a width (at least three quarters of a spacing) of a branch-point, of a
    crossing."""
    near = np.zeros((len(graph.xy), 2), bool)
    reach = np.maximum(1.8 * graph.radii, 0.75 * graph.spacing)
    crossings = np.array([m.xy for m in harness.crossings]).reshape(-1, 2)
    for column, points in enumerate((harness.branch_xy, crossings)):
        if len(points):
            near[:, column] = cKDTree(points).query(graph.xy)[0] <= reach
    return near


def encode_angles(angles: FloatArray, classes: int = 180, sigma_deg: float = 4.0) -> Float32Array:
    """``(n,)`` radians to ``(n, 180)`` targets: a periodic Gaussian of height 1 (thesis 6.5.6)."""
    away = np.abs(np.arange(classes)[None] - np.mod(np.rad2deg(angles), classes)[:, None])
    away = np.minimum(away, classes - away)
    return np.exp(-(away**2) / (2 * sigma_deg**2)).astype(np.float32)
