"""Where the picture has the edges of a DLO, compared with where the mask has them.

Symbols: I instances, N sampled sections across all of them, M places across an edge.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.directions import quarter_turned, tangents_of_each
from models.geometry.polylines import resample_each
from models.geometry.sampling import read_nearest
from models.instances.scene import Instance
from models.strands.seen import NOISE_LEVELS

_INSIDE_PX, _OUTSIDE_PX = 4, 7
"""How far a profile reaches to both sides of the mask's edge."""
_MOST_SHIFT = 4
"""Edges inside the mask's are not believed: foreground that a network is sure of stays."""
_USUAL = (0.3, 0.75)
"""Half widths, in widths of the instance, between which a place is neither damaged nor at a
crossing."""
_SPACING_PX = 4.0
_AT_MOST = 120
"""Sections across an instance."""
_PRIOR = 0.004
"""What a shift costs, times its square: shares of the color variance that the edge has to
explain."""


def edge_shifts(
    instances: Sequence[Instance], distances: Float32Array, image: ByteArray
) -> FloatArray:
    """``(I,)`` whole pixels by which each instance's edges in the picture lie outside its mask, 0
    to 4.

    Strategy: colors are read across both edges at many places. For every possible edge, the share
    of the colors' variance that two means (inside, outside) explain is averaged over all places of
    the instance; the best one, less a price for moving, is taken. Where an instance meets another,
    or the picture ends, nothing is read.
    """
    shifts = np.zeros(len(instances))
    owner, points, normals, half = _sections(instances, distances)
    if not len(owner):
        return shifts
    across = np.arange(-_INSIDE_PX, _OUTSIDE_PX + 1)
    explained, weight = np.zeros((len(across) - 1, len(instances))), np.zeros(len(instances))
    for side in (-1, 1):
        reach = side * (half[:, None] + across)
        places = points[:, None] + reach[..., None] * normals[:, None]
        alone = _alone(places, distances, image.shape)
        share = _explained(read_nearest(image, places[alone]).astype(np.float32))
        mine = owner[alone]
        cells = np.arange(len(share))[:, None] * len(instances) + mine
        explained += np.bincount(cells.ravel(), share.ravel(), explained.size).reshape(
            explained.shape
        )
        weight += np.bincount(mine, minlength=len(instances))
    return _best_shifts((explained / np.maximum(weight, 1)).T, weight > 0)


def _best_shifts(explained: FloatArray, known: BoolArray) -> FloatArray:
    """Entry k of the profile splits between places k and k + 1; the mask's own edge is after place
    ``_INSIDE_PX``."""
    shift = np.arange(explained.shape[1]) - _INSIDE_PX
    allowed = (shift >= 0) & (shift <= _MOST_SHIFT)
    worth = np.where(allowed, explained - _PRIOR * shift**2, -np.inf)
    out: FloatArray = np.where(known, shift[worth.argmax(axis=1)], 0.0)
    return out


def _sections(
    instances: Sequence[Instance], distances: Float32Array
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Owner ``(N,)``, middle ``(N, 2)``, unit normal ``(N, 2)`` and half width of the mask
    ``(N,)``."""
    if not instances:
        return np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    lengths = np.array([i.length_px for i in instances])
    counts = np.clip(lengths / _SPACING_PX, 3, _AT_MOST).astype(np.int64)
    owner = np.repeat(np.arange(len(instances)), counts)
    middle = resample_each([i.centerline_xy for i in instances], counts)
    normals = quarter_turned(tangents_of_each(middle, owner))
    widths = np.array([i.width_px for i in instances])[owner]
    half = read_nearest(distances, middle) - 0.5
    thin, thick = _USUAL
    usual = (half > thin * widths) & (half < thick * widths)
    return owner[usual], middle[usual], normals[usual], half[usual]


def _alone(places: FloatArray, distances: Float32Array, shape: tuple[int, ...]) -> BoolArray:
    """``(N,)`` nothing but background is outside the edge, and all of ``(N, M, 2)`` is in the
    picture: as both of its ends are."""
    outside = read_nearest(distances, places[:, _INSIDE_PX + 2 :]) > 0
    ends = places[:, [0, -1]]
    inside = np.all((ends >= 0) & (ends <= np.array(shape[1::-1]) - 1), axis=(1, 2))
    return inside & ~outside.any(axis=1)


def _explained(colors: Float32Array) -> Float32Array:
    """``(M - 1, N)`` share of the variance of ``(N, M, 3)`` colors that a split after each place
    explains."""
    rows = np.ascontiguousarray(
        colors.transpose(1, 2, 0)
    )  # with N last, every operation runs along memory
    count = len(rows)
    before = np.arange(1, count, dtype=np.float32)[:, None, None]
    sums = np.cumsum(rows, axis=0)
    total = sums[-1]
    left, right = sums[:-1], total - sums[:-1]
    between = (left**2 / before + right**2 / (count - before) - total**2 / count).sum(axis=1)
    variance = (rows**2).sum(axis=(0, 1)) - (total**2).sum(axis=0) / count
    out: Float32Array = between / (variance + 3 * count * NOISE_LEVELS**2)
    return out
