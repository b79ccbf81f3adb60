"""A foreground mask to the network of its strands: joints, free ends, and the medial line between them.

Symbols: P skeleton pixels. A *joint* is a connected group of pixels that have three neighbors or more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from models.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from models.geometry.polylines import arc_lengths
from models.geometry.sampling import read_nearest

_AROUND = np.array([[dx, dy] for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy])
_MOST_MARGIN = 48
_SMOOTHING = 7
"""Points of the moving average that takes the pixel steps out of a medial line."""


@dataclass(frozen=True, eq=False)
class Strand:
    """A medial line between two knots (``a`` at its first, ``b`` at its last point; equal for a ring).

    ``xy``: ``(n, 2)`` about a pixel apart; ``radii``: ``(n,)`` distance to the background.
    """

    a: int
    b: int
    xy: FloatArray
    radii: FloatArray

    @property
    def length(self) -> float:
        return float(arc_lengths(self.xy)[-1])

    def reversed(self) -> Strand:
        return Strand(self.b, self.a, self.xy[::-1], self.radii[::-1])

    def followed_by(self, other: Strand) -> Strand:
        """One strand of two, of which the second starts where the first ends."""
        xy, radii = np.concatenate((self.xy, other.xy[1:])), np.concatenate((self.radii, other.radii[1:]))
        return Strand(self.a, other.b, xy, radii)

    def seen_from(self, knot: int) -> Strand:
        """The strand with ``knot`` at its first point."""
        return self if self.a == knot else self.reversed()


@dataclass(frozen=True, eq=False)
class Web:
    """``knots_xy``: ``(K, 2)`` joints and free ends; the strands between them."""

    knots_xy: FloatArray
    strands: tuple[Strand, ...]


def find_web(mask: BoolArray, distances: Float32Array) -> Web:
    """The strands of ``(H, W)`` foreground, as its skeleton shows them: nothing is left out yet."""
    if not mask.any():
        return Web(np.zeros((0, 2)), ())
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    # Where a strand leaves the picture it is carried on a little: cut off square, it would fork into two corners.
    margin = min(_MOST_MARGIN, int(distances.max()) + 2)
    before, after = (left, top), (mask.shape[1] - left - width, mask.shape[0] - top - height)
    window = mask[top : top + height, left : left + width]
    beyond = [[margin if space == 0 else 0 for space in pair] for pair in zip(before, after, strict=True)]
    carried = np.pad(window, beyond[::-1], mode="edge")
    pixels = skeletonize(carried)[beyond[1][0] : beyond[1][0] + height, beyond[0][0] : beyond[0][0] + width]
    return _trace(np.pad(pixels, 1), np.array([left - 1, top - 1]), distances)


def _trace(pixels: BoolArray, corner: IntArray, distances: Float32Array) -> Web:
    """Strategy: number the skeleton's pixels, look up all neighbors at once, group pixels with three or more
    into joints, and walk the rest, which have two at most."""
    rows, columns = np.nonzero(pixels)
    points: NDArray[Any] = np.stack((columns, rows), axis=1).astype(np.int64)
    numbers = np.full(pixels.shape, -1, np.int64)
    numbers[rows, columns] = np.arange(len(points))
    around = numbers[rows[:, None] + _AROUND[:, 1], columns[:, None] + _AROUND[:, 0]]
    crowded = np.count_nonzero(around >= 0, axis=1) > 2
    groups = np.zeros(pixels.shape, np.uint8)
    groups[rows[crowded], columns[crowded]] = 1
    _, labels = cv2.connectedComponents(groups, connectivity=8)
    joint_of = labels[rows, columns].astype(np.int64) - 1  # -1: no joint
    knots = _means(points, joint_of)
    joints_around = np.where(around >= 0, joint_of[around], -1)
    chained = np.where((around >= 0) & ~crowded[around] & ~crowded[:, None], around, -1)
    chains = _walk(np.sort(chained, axis=1)[:, ::-1][:, :2].tolist(), crowded)
    strands = []
    for chain in chains:
        ends = _ends(chain, joints_around, knots, points)
        strands.append(_strand(chain, ends, points, knots, corner, distances))
    placed: FloatArray = np.array(knots, dtype=np.float64).reshape(-1, 2) + corner
    return Web(placed, tuple(strands))


def _means(points: IntArray, joint_of: IntArray) -> list[FloatArray]:
    """The middle of every joint's pixels."""
    inside = joint_of >= 0
    sizes = np.bincount(joint_of[inside])
    sums = [np.bincount(joint_of[inside], points[inside, axis]) for axis in (0, 1)]
    return list(np.stack(sums, axis=1) / sizes[:, None])


def _walk(neighbors: list[list[int]], crowded: BoolArray) -> list[list[int]]:
    """Ordered pixels of every chain: from its ends first, what is left then are rings."""
    seen = crowded.tolist()
    order = sorted(range(len(neighbors)), key=lambda k: neighbors[k][1] >= 0)
    chains = []
    for start in order:
        if seen[start]:
            continue
        chain, here = [], start
        while here >= 0 and not seen[here]:
            seen[here] = True
            chain.append(here)
            first, second = neighbors[here]
            here = first if first >= 0 and not seen[first] else second
        chains.append(chain)
    return chains


def _ends(chain: list[int], joints_around: IntArray, knots: list[FloatArray], points: IntArray) -> tuple[int, int]:
    """The knots of a chain's two ends; a free end becomes a new one. A ring has one knot twice."""
    first = [int(j) for j in np.unique(joints_around[chain[0]]) if j >= 0]
    last = [int(j) for j in np.unique(joints_around[chain[-1]]) if j >= 0]
    if len(chain) == 1 and len(first) > 1:
        return first[0], first[1]
    if len(chain) == 1:
        last = []
    closes = len(chain) > 3 and np.abs(points[chain[0]] - points[chain[-1]]).max() <= 1 and not first and not last
    a = first[0] if first else _new_knot(knots, points[chain[0]])
    if closes:
        return a, a
    return a, last[0] if last else _new_knot(knots, points[chain[-1]])


def _new_knot(knots: list[FloatArray], point: IntArray) -> int:
    knots.append(point.astype(np.float64))
    return len(knots) - 1


def _strand(
    chain: list[int], ends: tuple[int, int], points: IntArray, knots: list[FloatArray], corner: IntArray,
    distances: Float32Array,
) -> Strand:  # fmt: skip
    line: NDArray[Any] = np.concatenate((knots[ends[0]][None], points[chain], knots[ends[1]][None])) + 1.0 * corner
    xy = smoothed(line)
    return Strand(ends[0], ends[1], xy, read_nearest(distances, line))


def smoothed(line: FloatArray) -> FloatArray:
    """A moving average along ``(n, 2)`` that keeps both ends where they are."""
    reach = min(_SMOOTHING // 2, (len(line) - 1) // 2)
    if reach < 1:
        return line.astype(np.float64)
    head, tail = 2 * line[0] - line[reach:0:-1], 2 * line[-1] - line[-2 : -reach - 2 : -1]
    sums = np.cumsum(np.concatenate((np.zeros((1, 2)), head, line, tail)), axis=0)
    out: FloatArray = (sums[2 * reach + 1 :] - sums[: -2 * reach - 1]) / (2 * reach + 1)
    return out
