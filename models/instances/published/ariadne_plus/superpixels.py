"""From image and mask to the region adjacency graph of Ariadne+ (thesis 3.3.2 to 3.3.5).

Symbols: R superpixels, numbered from 0; G nodes after simplification.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from skimage.measure import label
from skimage.segmentation import slic

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.geometry.components import components

_COMPACTNESS = 40.0
_LEAST_AREA = 2.0
"""Typical area of a superpixel in squared widths, at least: smaller ones lie side by side across a
DLO and fork."""
_GRADIENT = 5
"""Side of the kernel that finds a superpixel's neighbors."""
_SLIVER = 0.3
"""Superpixels smaller than this times the median are left out where nothing hangs on them."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The graph of superpixels after simplification.

    ``xy``: ``(G, 2)`` centroids. ``neighbors``: for each node the nodes beside it, ascending.
    ``is_intersection``: ``(G,)``. ``tips``: ``(G, 2)`` the pixel of the superpixel farthest from
    its only neighbor (the centroid itself for nodes with another number of neighbors): a path
    starts there.
    """

    xy: FloatArray
    neighbors: tuple[tuple[int, ...], ...]
    is_intersection: BoolArray
    tips: FloatArray


def region_graph(
    mask: BoolArray, image: ByteArray | None, superpixels: int, width_px: float
) -> Regions:
    """MaskSLIC, adjacency, and intersections as single nodes.

    ``superpixels``: how many at most; ``width_px``: typical width of the foreground, which bounds
    them too.

    Strategy: one pass over the label array finds all neighbors: labels of pixels one step right,
    down and along both diagonals are compared with their own. No mask is made for any superpixel.
    """
    if not mask.any():
        return Regions(np.zeros((0, 2)), (), np.zeros(0, bool), np.zeros((0, 2)))
    large = int(np.count_nonzero(mask) / (_LEAST_AREA * max(width_px, 1.0) ** 2))
    labels = _superpixels(mask, image, min(superpixels, max(large, 2)))
    rows, columns = np.nonzero(labels)
    of = labels[rows, columns] - 1
    count = int(labels.max(initial=0))
    area = np.bincount(of, minlength=count)
    place = np.stack((columns, rows), axis=1).astype(np.float64)
    pairs = _adjacent(_grown(labels), count)
    pairs = pairs[~_slivers(pairs, area)[pairs].any(axis=1)]
    node = _simplified(pairs, count)
    around = _around(node, pairs)
    node = _fused_forks(node, around)
    around = _around(node, pairs)
    middles = _means(place, node[of], len(around))
    crossing = np.array([len(beside) > 2 for beside in around], dtype=bool)
    tips = _tips(place, node[of], around, middles)
    return Regions(middles, tuple(tuple(sorted(beside)) for beside in around), crossing, tips)


def _slivers(pairs: IntArray, area: IntArray) -> BoolArray:
    """``(R,)`` small superpixels whose neighbors all touch each other: beside the way, not on it.

    Each would make a false intersection of its neighbor.
    """
    around = _around(np.arange(len(area)), pairs)
    out = np.zeros(len(area), dtype=bool)
    for region in np.flatnonzero(area < _SLIVER * np.median(area)).tolist() if len(area) else []:
        beside = around[region]
        out[region] = all(
            other in around[one] for one in beside for other in beside if other != one
        )
    return out


def _around(node: IntArray, pairs: IntArray) -> list[set[int]]:
    """The neighbors of every node, where ``node`` is the node of each superpixel."""
    around: list[set[int]] = [set() for _ in range(int(node.max(initial=-1)) + 1)]
    for a, b in np.unique(node[pairs].reshape(-1, 2), axis=0).tolist():
        if a != b:
            around[a].add(b)
            around[b].add(a)
    return around


def _fused_forks(node: IntArray, around: list[set[int]]) -> IntArray:
    """Beyond the thesis: two forks with at most two nodes between are the ends of one shallow
    crossing.

    A fork is an intersection of three branches; the nodes between become part of the one
    intersection.
    """
    forks = {k for k, beside in enumerate(around) if len(beside) == 3}
    into = np.arange(len(around))
    for fork in sorted(forks):
        for first in sorted(around[fork]):
            between, far = [first], first
            for _ in range(2):
                onward = around[far] - {fork, *between}
                if len(around[far]) != 2 or len(onward) != 1:
                    break
                far = min(onward)
                if far in forks:
                    break
                between.append(far)
            if far in forks and far != fork and into[far] == far and into[fork] == fork:
                into[[*between, far]] = fork
                forks -= {fork, far}
                break
    _, renumbered = np.unique(into[node], return_inverse=True)
    return renumbered.ravel().astype(np.int64)


def _superpixels(mask: BoolArray, image: ByteArray | None, count: int) -> IntArray:
    """``(H, W)`` labels from 1, 0 off the mask. A color picture makes superpixels; without one,
    position alone."""
    picture = np.zeros((*mask.shape, 3), np.uint8) if image is None else image
    found = slic(
        picture,
        n_segments=count,
        compactness=_COMPACTNESS,
        mask=mask,
        start_label=1,
        max_num_iter=5,
        enforce_connectivity=True,
        channel_axis=-1,
    )
    # SLIC leaves some foreground without a cluster: its pieces are superpixels, too.
    left = label(mask & (found == 0), connectivity=2)
    found = np.where(left > 0, left + found.max(), found)
    # A cluster of colors may lie in two places: each is a superpixel of its own.
    return label(np.where(mask, found, 0), connectivity=2).astype(np.int64)


def _grown(labels: IntArray) -> IntArray:
    """The labels grown by a pixel or two into the background: the morphological gradient of 3.3.3,
    all at once."""
    beyond = cv2.dilate(labels.astype(np.uint16), np.ones((_GRADIENT, _GRADIENT), np.uint8))
    return np.where(labels > 0, labels, beyond).astype(np.int64)


def _adjacent(labels: IntArray, count: int) -> IntArray:
    """``(m, 2)`` pairs of superpixels (from 0, ascending) that touch."""
    steps = (
        (labels[:, :-1], labels[:, 1:]),
        (labels[:-1], labels[1:]),
        (labels[:-1, :-1], labels[1:, 1:]),
        (labels[:-1, 1:], labels[1:, :-1]),
    )
    keys = []
    for one, other in steps:
        meet = (one != other) & (one > 0) & (other > 0)
        a, b = one[meet] - 1, other[meet] - 1
        keys.append(np.minimum(a, b) * count + np.maximum(a, b))
    return np.stack(np.divmod(np.unique(np.concatenate(keys)), max(count, 1)), axis=1)


def _simplified(pairs: IntArray, count: int) -> IntArray:
    """``(R,)`` node of every superpixel: touching superpixels with more than two neighbors become
    one (3.3.4)."""
    degree = np.bincount(pairs.ravel(), minlength=count)
    both = pairs[(degree[pairs] > 2).all(axis=1)]
    return components(both, count)


def _means(values: FloatArray, of: IntArray, count: int) -> FloatArray:
    sums = np.stack([np.bincount(of, values[:, axis], count) for axis in (0, 1)], axis=1)
    out: FloatArray = sums / np.maximum(np.bincount(of, minlength=count), 1)[:, None]
    return out


def _tips(
    place: FloatArray, of: IntArray, around: list[set[int]], middles: FloatArray
) -> FloatArray:
    """Of every end node, the pixel that is farthest from its neighbor's centroid."""
    tips = middles.copy()
    order = np.argsort(of, kind="stable")
    bounds = np.searchsorted(of[order], np.arange(len(around) + 1))
    for node, beside in enumerate(around):
        if len(beside) == 1:
            pixels = place[order[bounds[node] : bounds[node + 1]]]
            away = np.hypot(*(pixels - middles[min(beside)]).T)
            tips[node] = pixels[int(np.argmax(away))]
    return tips
