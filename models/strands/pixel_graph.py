"""A skeleton's pixels as a graph: junctions, and the ordered pixel chains between them.

Symbols: P skeleton pixels, C chains, J junctions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from skimage.morphology import skeletonize

from models.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from models.geometry.components import components
from models.strands.foreground import Foreground

_WIDE_PX = 8.0
_SMOOTHING_PX = 3
FREE = -1
"""From this width on a skeleton is traced at half the size; what stands for no junction at a
chain's end."""


@dataclass(frozen=True, eq=False)
class PixelGraph:
    """Chains of pixels between junctions.

    ``xy``: ``(N, 2)`` the pixels of all chains, one chain after the other, each in order along it.
    ``bounds``: ``(C + 1,)`` where each chain starts in ``xy``. ``ends``: ``(C, 2)`` junction at a
    chain's first and last pixel, ``FREE`` for none. ``closed``: ``(C,)`` a ring without any
    junction. ``junction_xy``: ``(J, 2)`` middles.
    """

    xy: IntArray
    bounds: IntArray
    ends: IntArray
    closed: BoolArray
    junction_xy: FloatArray


def trace(foreground: Foreground, halve: bool = True) -> PixelGraph:
    """The graph of the foreground's skeleton, in the picture.

    Where strands are wide enough it is found at half the size, in a quarter of the time, if
    ``halve`` allows it. A halved mask's skeleton is up to two pixels beside the middle: its points
    go uphill in the distances.
    """
    margin = foreground.margin
    if not halve or foreground.width_px < _WIDE_PX:
        return pixel_graph(skeleton_of(foreground.beyond)[margin:-margin, margin:-margin])
    half = margin // 2
    graph = doubled(pixel_graph(skeleton_of(halved(foreground.beyond))[half:-half, half:-half]))
    return replace(graph, xy=uphill(graph.xy, foreground.distances, 2))


def skeleton_of(mask: BoolArray) -> BoolArray:
    """``(H, W)`` one pixel wide."""
    out = np.zeros(mask.shape, dtype=bool)
    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(mask).view(np.uint8))
    if width:
        window = np.s_[top : top + height, left : left + width]
        out[window] = skeletonize(mask[window])
    return out


def pixel_graph(skeleton: BoolArray) -> PixelGraph:
    """The graph of an ``(H, W)`` skeleton.

    Strategy: two pixels are neighbors if they touch by a side, or by a corner with no third pixel
    beside both. A pixel with more than two neighbors belongs to a junction; junction pixels that
    touch are one junction. Without them only paths and rings are left. Every path is ordered by
    pointer doubling: each pixel looks along the path in both directions, and in log2 P rounds of
    array operations it knows both ends and its distance.
    """
    pixels, neighbors = _neighbors(skeleton)
    degree = (neighbors >= 0).sum(axis=1)
    is_junction = degree > 2
    junction_of, junction_xy = _junctions(pixels, neighbors, is_junction)
    two = _two_neighbors(neighbors, is_junction)
    chain_of, place, ring = _ordered(two, ~is_junction)
    order = np.lexsort((place, chain_of))
    order = order[chain_of[order] >= 0]
    starts = np.flatnonzero(np.diff(chain_of[order], prepend=-1))
    bounds = np.append(starts, len(order)).astype(np.int64)
    first, last = order[bounds[:-1]], order[bounds[1:] - 1]
    ends = _end_junctions(first, last, neighbors, junction_of)
    return PixelGraph(pixels[order], bounds, ends, ring[first], junction_xy)


def _neighbors(skeleton: BoolArray) -> tuple[IntArray, IntArray]:
    """``(P, 2)`` pixels (x, y) and ``(P, 8)`` indices of their neighbors, -1 for none; sides
    first."""
    padded = np.pad(skeleton, 1)
    width = padded.shape[1]
    flat = np.flatnonzero(padded)
    index = np.full(padded.size, -1, dtype=np.int32)
    index[flat] = np.arange(len(flat), dtype=np.int32)
    sides = np.array([-width, 1, width, -1])
    corners = np.array([-width + 1, width + 1, width - 1, -width - 1])
    near = index[flat[:, None] + sides]
    far = index[flat[:, None] + corners]
    # Corner k is between sides k and k + 1: with either of them there, the two pixels are linked
    # already.
    far[(near >= 0) | (np.roll(near, -1, axis=1) >= 0)] = -1
    pixels = np.stack((flat % width - 1, flat // width - 1), axis=1).astype(np.int64)
    return pixels, np.concatenate((near, far), axis=1).astype(np.int64)


def _junctions(
    pixels: IntArray, neighbors: IntArray, is_junction: BoolArray
) -> tuple[IntArray, FloatArray]:
    """``(P,)`` junction of every pixel, -1 for none, and ``(J, 2)`` their middles."""
    of = np.full(len(pixels), -1, dtype=np.int64)
    members = np.flatnonzero(is_junction)
    if not len(members):
        return of, np.zeros((0, 2))
    local = np.full(len(pixels) + 1, -1, dtype=np.int64)
    local[members] = np.arange(len(members))
    linked = local[neighbors[members]]  # neighbor -1 reads the extra last entry, which stays -1
    rows, columns = np.nonzero(linked >= 0)
    label = components(np.stack((rows, linked[rows, columns]), axis=1), len(members))
    count = int(label.max()) + 1
    of[members] = label
    sums = np.stack([np.bincount(label, pixels[members, axis], count) for axis in (0, 1)], axis=1)
    middles: FloatArray = sums / np.bincount(label, minlength=count)[:, None]
    return of, middles


def _two_neighbors(neighbors: IntArray, is_junction: BoolArray) -> IntArray:
    """``(P, 2)``: the neighbors of path pixels that are path pixels, -1 where there is none."""
    kept = np.where(
        (neighbors >= 0) & ~is_junction[neighbors] & ~is_junction[:, None], neighbors, -1
    )
    ranked = -np.partition(-kept, 1, axis=1)[:, :2] if len(kept) else kept[:, :2]
    out: IntArray = np.sort(ranked, axis=1)[:, ::-1]
    return np.ascontiguousarray(out)


def _ordered(two: IntArray, is_path: BoolArray) -> tuple[IntArray, IntArray, BoolArray]:
    """For every pixel: its chain's name (-1 off the paths), its place along it, and whether that is
    a ring."""
    last, steps, least = _walk(two)
    ring = is_path & (two[last >> 1, last & 1] >= 0).any(axis=1)
    if ring.any():
        cut = np.unique(least[ring])
        two = two.copy()
        other = two[cut, 0]
        two[cut, 0] = -1
        two[other] = np.where(two[other] == cut[:, None], -1, two[other])
        last, steps, _ = _walk(two)
    end = last >> 1
    flip = end[:, 1] < end[:, 0]
    chain = np.where(is_path, end.min(axis=1), -1)
    return chain, np.where(flip, steps[:, 1], steps[:, 0]), ring


def _walk(two: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Where both directions from each pixel end (``2 * pixel + direction``), how far off, least
    pixel met."""
    count = len(two)
    own = np.arange(2 * count, dtype=np.int64).reshape(count, 2)
    onward = 2 * two + (two[two, 0] == np.arange(count)[:, None])
    following = np.where(two >= 0, onward, own).ravel()
    steps = (two >= 0).astype(np.int64).ravel()
    least = np.repeat(np.arange(count), 2)
    for _ in range(max(1, int(np.ceil(np.log2(max(count, 2)))) + 1)):
        steps = steps + steps[following]
        least = np.minimum(least, least[following])
        following = following[following]
    return following.reshape(count, 2), steps.reshape(count, 2), least.reshape(count, 2).min(axis=1)


def _end_junctions(
    first: IntArray, last: IntArray, neighbors: IntArray, junction_of: IntArray
) -> IntArray:
    """``(C, 2)`` junctions beside the first and last pixel of each chain."""
    extended = np.append(junction_of, FREE)
    at_first, at_last = (
        np.sort(extended[neighbors[pixel]], axis=1)[:, ::-1] for pixel in (first, last)
    )
    alone = first == last
    # A chain of one pixel has both junctions beside that pixel.
    return np.stack((at_first[:, 0], np.where(alone, at_last[:, 1], at_last[:, 0])), axis=1)


def halved(mask: BoolArray) -> BoolArray:
    """``(H // 2, W // 2)``: foreground where all four pixels are, so that no gap between strands
    closes."""
    height, width = mask.shape[0] // 2 * 2, mask.shape[1] // 2 * 2
    rows = mask[0:height:2, :width] & mask[1:height:2, :width]
    return rows[:, ::2] & rows[:, 1::2]


def doubled(graph: PixelGraph) -> PixelGraph:
    """The graph of a halved mask in the pixels of the whole one: chains are dense again, a point
    every pixel."""
    lengths = np.diff(graph.bounds)
    bounds = 2 * graph.bounds - np.arange(len(graph.bounds))
    xy = np.zeros((int(bounds[-1]), 2), dtype=np.int64)
    own = 2 * np.arange(len(graph.xy)) - np.repeat(np.arange(len(lengths)), lengths)
    xy[own] = 2 * graph.xy
    is_between = np.ones(len(xy), dtype=bool)
    is_between[own] = False
    between = np.flatnonzero(is_between)
    xy[between] = (xy[between - 1] + xy[between + 1]) // 2
    return PixelGraph(xy, bounds, graph.ends, graph.closed, 2 * graph.junction_xy + 0.5)


def uphill(points_xy: IntArray, heights: Float32Array, steps: int) -> IntArray:
    """``(n, 2)`` pixels, each moved so many times to the highest of itself and its 8 neighbors
    (itself if equal)."""
    offsets = np.array(
        [(0, 0), (0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (1, 1), (-1, 1), (1, -1)]
    )
    framed = np.asarray(cv2.copyMakeBorder(heights, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=-1))
    width = framed.shape[1]
    around = offsets[:, 1] * width + offsets[:, 0]
    flat, values = (points_xy[:, 1] + 1) * width + points_xy[:, 0] + 1, framed.ravel()
    for _ in range(steps):
        flat = flat + around[values[flat[:, None] + around].argmax(axis=1)]
    return np.stack((flat % width - 1, flat // width - 1), axis=1)


def smoothed(points: FloatArray | IntArray, bounds: IntArray) -> FloatArray:
    """``(N, 2)`` points of consecutive chains, each the mean of up to three neighbors to both
    sides.

    The window shrinks towards a chain's ends, which stay where they are.
    """
    lengths = np.diff(bounds)
    place = np.arange(len(points)) - np.repeat(bounds[:-1], lengths)
    room = np.minimum(np.minimum(place, np.repeat(lengths, lengths) - 1 - place), _SMOOTHING_PX)
    sums = np.concatenate(
        (np.zeros((1, points.shape[1])), np.cumsum(points, axis=0, dtype=np.float64))
    )
    here = np.arange(len(points))
    out: FloatArray = (sums[here + room + 1] - sums[here - room]) / (2 * room + 1)[:, None]
    return out
