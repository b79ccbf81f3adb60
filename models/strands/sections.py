"""Skeleton chains as sections of DLOs, cut back from the places where the skeleton leaves the DLO.

Symbols: S sections, E = 2 S ends (end ``2 s`` is the start of section ``s``, ``2 s + 1`` its other
end).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.components import components
from models.geometry.directions import quarter_turned, unit
from models.geometry.sampling import middle, read_nearest
from models.strands.pixel_graph import FREE, PixelGraph, smoothed

_LOOK = 24
"""Samples of the stretch behind an end that gives its direction, width and color."""
_LOOK_RADII, _LOOK_PX = 6 / 1.15, 10 / 1.15
"""Its length; at least so many pixels."""
_CUT_AT_MOST_RADII = 2.5
"""What is cut off at a junction, in radii there: one at least, as the skeleton runs into the
junction, not along a DLO."""
_THICK = 1.2
"""A section is cut back while it is thicker than this times its own typical radius."""
_LEAST_OF_TYPICAL = 0.75
"""Where a mask breaks off it is often thin: an end counts as at least so much of its section's
typical radius."""
_SPUR_RADII = 1.5
_MAX_SECTIONS = 3_000
NEAREST = 24
"""So many other ends at most are considered for each end of a junction, or across gaps."""


@dataclass(frozen=True, eq=False)
class Sections:
    """S sections and what is known at their E ends.

    ``xy``, ``bounds``: centerline points of all sections and where each starts. ``closed``:
    ``(S,)`` rings. ``radius``: ``(S,)`` typical half width; ``length``: ``(S,)`` pixels. ``node``:
    ``(E,)`` the group of junctions at the end, -1 for a free end. ``tip``: ``(E, 2)`` its place;
    ``outward``: ``(E, 2)`` unit direction out of it; ``end_radius``: ``(E,)``; ``color``: ``(E,
    3)`` RGB (0 without a picture); ``beside``: ``(E, 3)`` the color next to it; ``to_edge``:
    ``(E,)`` distance to the picture's edge.
    """

    xy: FloatArray
    bounds: IntArray
    closed: BoolArray
    radius: FloatArray
    length: FloatArray
    node: IntArray
    tip: FloatArray
    outward: FloatArray
    end_radius: FloatArray
    color: FloatArray
    beside: FloatArray
    to_edge: FloatArray

    @property
    def at_border(self) -> BoolArray:
        """``(E,)`` whether the picture ends there."""
        return self.to_edge <= np.maximum(self.end_radius, 2.0)

    def __len__(self) -> int:
        return len(self.closed)

    def points(self, section: int) -> FloatArray:
        return self.xy[self.bounds[section] : self.bounds[section + 1]]


def sections_of(
    graph: PixelGraph, distances: Float32Array, image: ByteArray | None, shared_radii: float = 0.0
) -> Sections:
    """The chains of a pixel graph without spurs, cut at junctions.

    ``shared_radii``: a chain up to so many radii long between two forks is the foreground that two
    crossing DLOs share: it is left out and the forks become one group.

    Strategy: a chain of which at most a radius would be left is inside a crossing; its junctions
    become one group. All values at ends come from one gather: ``_LOOK`` samples a few radii back
    along the chain from each end.
    """
    bounds, lengths = graph.bounds, np.diff(graph.bounds)
    radii = np.maximum(distances[graph.xy[:, 1], graph.xy[:, 0]].astype(np.float64) - 0.5, 0.5)
    typical = _medians(radii, bounds)
    junction_radius = np.maximum(_junction_radii(graph, distances), 1.0)
    cut = _cuts(graph, radii, typical, junction_radius)
    inside = lengths <= cut.sum(axis=1) + typical
    inner = inside & (graph.ends != FREE).all(axis=1) & ~graph.closed
    spur = ((graph.ends == FREE).sum(axis=1) == 1) & _is_spur(graph, lengths, junction_radius)
    if shared_radii > 0:
        inner[
            _between_forks(graph, ~inner & ~spur, lengths / np.maximum(typical, 1.0), shared_radii)
        ] = True
    group = components(graph.ends[inner], len(junction_radius))
    kept = np.flatnonzero(~inner & ~spur & (lengths >= 2))
    kept = np.sort(kept[np.argsort(-lengths[kept], kind="stable")[:_MAX_SECTIONS]])
    cut = np.minimum(cut[kept], np.maximum(lengths[kept, None] // 2 - 1, 0))
    first, last = bounds[kept] + cut[:, 0], bounds[kept + 1] - cut[:, 1]
    smooth = smoothed(graph.xy, bounds)
    rows = np.concatenate(
        [np.arange(a, b) for a, b in zip(first, last, strict=True)] or [np.zeros(0, np.int64)]
    )
    new_bounds = np.concatenate(([0], np.cumsum(last - first))).astype(np.int64)
    colors = (
        np.zeros((len(rows), 3))
        if image is None
        else image[graph.xy[rows, 1], graph.xy[rows, 0]].astype(float)
    )
    xy, radii = smooth[rows], radii[rows]
    nodes = np.append(group, FREE)[graph.ends[kept]].ravel()
    # Where all but one chain were spurs, that one simply ends.
    nodes[
        np.append(np.bincount(nodes[nodes != FREE], minlength=len(graph.junction_xy)) == 1, False)[
            nodes
        ]
    ] = FREE
    return _with_ends(
        xy, new_bounds, graph.closed[kept], radii, colors, nodes, distances.shape, image
    )


def _with_ends(
    xy: FloatArray,
    bounds: IntArray,
    closed: BoolArray,
    radii: FloatArray,
    colors: FloatArray,
    nodes: IntArray,
    shape: tuple[int, ...],
    image: ByteArray | None,
) -> Sections:
    count, lengths = len(closed), np.diff(bounds)
    base = np.stack((bounds[:-1], bounds[1:] - 1), axis=1).ravel()
    sign = np.tile([1, -1], count)
    own = _medians(radii, bounds)
    typical = np.repeat(own, 2)
    reach = np.minimum(np.maximum(_LOOK_RADII * typical, _LOOK_PX), np.repeat(lengths, 2) - 1)
    offsets = np.rint(np.linspace(0, 1, _LOOK) * reach[:, None]).astype(np.int64)
    samples = base[:, None] + sign[:, None] * offsets if count else np.zeros((0, _LOOK), np.int64)
    looked = xy[samples]
    half, far = looked[:, _LOOK // 2], looked[:, -1]
    near, whole = unit(looked[:, 0] - half), unit(looked[:, 0] - far)
    outward = unit(near + 0.5 * (near - whole))
    step = np.hypot(*np.diff(xy, axis=0).T) if len(xy) > 1 else np.zeros(0)
    along = np.concatenate(([0.0], np.cumsum(step)))
    length = along[bounds[1:] - 1] - along[bounds[:-1]] if count else np.zeros(0)
    radius = np.maximum(middle(radii[samples], axis=1), _LEAST_OF_TYPICAL * typical)
    tip = looked[:, 0]
    margin = np.minimum(tip, np.array(shape[::-1]) - 1 - tip).min(axis=1)
    return Sections(
        xy,
        bounds,
        closed,
        own,
        length,
        nodes,
        tip,
        outward,
        radius,
        middle(colors[samples], axis=1),
        _beside(half, outward, typical, image),
        margin,
    )


def _beside(
    points: FloatArray, outward: FloatArray, radius: FloatArray, image: ByteArray | None
) -> FloatArray:
    """``(E, 3)`` mean color of both sides, two radii and two pixels away."""
    if image is None:
        return np.zeros((len(points), 3))
    normal = quarter_turned(outward) * (2 * radius + 2)[:, None]
    out: FloatArray = read_nearest(image, np.stack((points + normal, points - normal))).mean(axis=0)
    return out


def _medians(values: FloatArray, bounds: IntArray) -> FloatArray:
    """Median of each run of ``values``: sorted within the runs by one sort, then read at the
    middles."""
    lengths = np.diff(bounds)
    owner = np.repeat(np.arange(len(lengths)), lengths)
    ordered = values[np.lexsort((values, owner))]
    out: FloatArray = ordered[bounds[:-1] + lengths // 2]
    return out


def _junction_radii(graph: PixelGraph, distances: Float32Array) -> FloatArray:
    if not len(graph.junction_xy):
        return np.zeros(0)
    place = np.rint(graph.junction_xy).astype(np.int64)
    out: FloatArray = distances[place[:, 1], place[:, 0]].astype(np.float64) - 0.5
    return out


def _cuts(
    graph: PixelGraph, radii: FloatArray, typical: FloatArray, junction_radius: FloatArray
) -> IntArray:
    """``(C, 2)`` pixels to cut off at both ends of every chain; 0 at free ends."""
    lengths = np.diff(graph.bounds)
    at = np.append(junction_radius, 0.0)[graph.ends]
    least = np.ceil(at).astype(np.int64)
    most = np.ceil(_CUT_AT_MOST_RADII * at).astype(np.int64)
    span = int(min(most.max(initial=0), 400)) + 1
    steps = np.minimum(np.arange(span)[None], lengths[:, None] - 1)
    cuts = []
    for side, rows in enumerate(
        (graph.bounds[:-1, None] + steps, graph.bounds[1:, None] - 1 - steps)
    ):
        slim = radii[rows] <= _THICK * typical[:, None] + 0.5
        slim &= np.arange(span)[None] >= least[:, side, None]
        reached = np.where(slim.any(axis=1), slim.argmax(axis=1), span)
        cuts.append(np.minimum(reached, most[:, side]))
    return np.stack(cuts, axis=1)


def _is_spur(graph: PixelGraph, lengths: IntArray, junction_radius: FloatArray) -> BoolArray:
    """Short chains from a junction to nowhere: an uneven outline makes them."""
    at = np.append(junction_radius, 0.0)[graph.ends].max(axis=1)
    out: BoolArray = lengths <= np.maximum(_SPUR_RADII * at, 3)
    return out


def _between_forks(
    graph: PixelGraph, kept: BoolArray, length_radii: FloatArray, at_most: float
) -> list[int]:
    """Chains between two junctions of three chains each; shortest first, each junction once."""
    degree = np.bincount(
        graph.ends[kept][graph.ends[kept] != FREE], minlength=len(graph.junction_xy) + 1
    )
    forks = (graph.ends != FREE).all(axis=1) & (graph.ends[:, 0] != graph.ends[:, 1])
    forks &= kept & (degree[graph.ends] == 3).all(axis=1) & (length_radii <= at_most)
    chosen: list[int] = []
    taken: set[int] = set()
    for chain in sorted(np.flatnonzero(forks).tolist(), key=lambda c: float(length_radii[c])):
        a, b = graph.ends[chain].tolist()
        if a not in taken and b not in taken:
            taken |= {a, b}
            chosen.append(chain)
    return chosen


def pairs_at_junctions(sections: Sections) -> IntArray:
    """``(m, 2)`` pairs of ends at the same group of junctions; of large groups only near ones."""
    ends = np.flatnonzero(sections.node >= 0)
    order = ends[np.argsort(sections.node[ends], kind="stable")]
    bounds = np.flatnonzero(np.diff(sections.node[order], prepend=-2))
    found = [
        _near_pairs(group, sections.tip) for group in np.split(order, bounds[1:]) if len(group) > 1
    ]
    return np.concatenate(found) if found else np.zeros((0, 2), np.int64)


def _near_pairs(ends: IntArray, tips: FloatArray) -> IntArray:
    if len(ends) <= NEAREST:
        a, b = np.triu_indices(len(ends), 1)
    else:
        _, near = cKDTree(tips[ends]).query(tips[ends], NEAREST)
        a, b = np.repeat(np.arange(len(ends)), NEAREST), np.asarray(near).ravel()
        a, b = np.unique(np.stack((np.minimum(a, b), np.maximum(a, b)))[:, a != b], axis=1)
    return np.stack((ends[a], ends[b]), axis=1)
