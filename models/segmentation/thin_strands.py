"""Strands that are thin at the network's scale are looked at again, closer.

Strategy: a large picture is reduced before the network sees it, and a wire may be left with two or
three pixels. Where the first pass hints at something that thin, the picture is cut into tiles at
two or four times that scale, the ones with most hints first, until the budget is spent. In a tile
the closer look decides around the hints; elsewhere, and on thick strands, the first pass does,
which sees more of what is around.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, IntArray
from models.segmentation.segment import ForegroundInput, Network, enlarged, probability_at

THIN_PX = 7
"""A strand below this width at the network's scale loses a good part of its edge to the
reduction."""
_HINT = 0.15
"""Probability that is worth a second look; a wire of two pixels reaches little more in the first
pass."""
_LEAST_HINTS = 6
"""Pixels of a tile that hint at something thin; fewer are noise."""
_VERY_THIN_PX = 3.0
_NEAR = 0.8
"""From this scale on a picture has little more to show than the first pass saw."""
_CORE_PX, _MARGIN_PX = 384, 32
"""A tile at its own scale, and what it sees around itself."""


class _Tile(NamedTuple):
    """``rows`` and ``columns`` of the whole picture."""

    rows: slice
    columns: slice


def look_closer(
    image: ByteArray,
    probability: Float32Array,
    network: Network,
    settings: ForegroundInput,
    budget: float,
) -> Float32Array:
    """(H, W) probability of ``image`` (H, W, 3), of which ``probability`` (h, w) was seen at a
    smaller scale.

    ``budget`` bounds the work: pixels that the network sees, over those of the first pass.
    """
    whole = enlarged(probability, image.shape[:2])
    scale = probability.shape[1] / image.shape[1]
    if scale > _NEAR or not (hints := _thin(probability >= _HINT, THIN_PX)).any():
        return whole
    zoom = min(
        4.0 if _typical_width(probability >= _HINT, hints) < _VERY_THIN_PX else 2.0, 1.0 / scale
    )
    tile_px = (_CORE_PX + 2 * _MARGIN_PX) ** 2
    for tile in _tiles(
        hints, image.shape[:2], scale * zoom, int(budget * probability.size / tile_px)
    ):
        whole[tile.rows, tile.columns] = _closer(
            image, probability, tile, scale * zoom, network, settings
        )
    return whole


def _tiles(hints: BoolArray, size: tuple[int, int], scale: float, most: int) -> Iterator[_Tile]:
    """At most ``most`` tiles of a grid over the picture of ``size`` (H, W), those with most hints
    first."""
    core = round(_CORE_PX / scale)
    counts = cv2.resize(hints.astype(np.float32), size[::-1], interpolation=cv2.INTER_NEAREST)
    tiles = [
        _Tile(slice(y, min(y + core, size[0])), slice(x, min(x + core, size[1])))
        for y in range(0, size[0], core)
        for x in range(0, size[1], core)
    ]
    found = np.array([counts[tile.rows, tile.columns].sum() for tile in tiles])
    least = _LEAST_HINTS * size[0] * size[1] / hints.size
    for k in np.argsort(-found, kind="stable")[:most]:
        if found[k] >= least:
            yield tiles[k]


def _closer(
    image: ByteArray,
    probability: Float32Array,
    tile: _Tile,
    scale: float,
    network: Network,
    settings: ForegroundInput,
) -> Float32Array:
    """Probability of one tile, at the picture's own size."""
    margin = round(_MARGIN_PX / scale)
    rows = slice(max(tile.rows.start - margin, 0), min(tile.rows.stop + margin, image.shape[0]))
    columns = slice(
        max(tile.columns.start - margin, 0), min(tile.columns.stop + margin, image.shape[1])
    )
    close = probability_at(np.ascontiguousarray(image[rows, columns]), network, settings, scale)
    far = _part(probability, rows, columns, image.shape[:2], close.shape)
    zoom = scale * image.shape[1] / probability.shape[1]
    seen = np.maximum(close, far) >= 0.5
    thin_px = round(THIN_PX * zoom)
    thick = seen & ~_thin(seen, thin_px)
    hinted = cv2.dilate((far >= _HINT).astype(np.uint8), np.ones((thin_px, thin_px), np.uint8)) > 0
    merged = enlarged(
        np.where(hinted & ~thick, close, far),
        (rows.stop - rows.start, columns.stop - columns.start),
    )
    top, left = tile.rows.start - rows.start, tile.columns.start - columns.start
    height, width = tile.rows.stop - tile.rows.start, tile.columns.stop - tile.columns.start
    return merged[top : top + height, left : left + width]


def _part(
    probability: Float32Array,
    rows: slice,
    columns: slice,
    size: tuple[int, int],
    to: IntArray | tuple[int, ...],
) -> Float32Array:
    """What the first pass saw of ``rows`` and ``columns`` of the picture of ``size``, resampled to
    the size ``to``."""
    factor_y, factor_x = probability.shape[0] / size[0], probability.shape[1] / size[1]
    y = (rows.start + (np.arange(to[0]) + 0.5) * (rows.stop - rows.start) / to[0]) * factor_y - 0.5
    x = (
        columns.start + (np.arange(to[1]) + 0.5) * (columns.stop - columns.start) / to[1]
    ) * factor_x - 0.5
    grid_x, grid_y = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    return np.asarray(
        cv2.remap(probability, grid_x, grid_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def _thin(mask: BoolArray, width_px: int) -> BoolArray:
    """Pixels of ``mask`` where no disc of ``width_px`` fits, a pixel away from where one does."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width_px, width_px))
    opened = cv2.morphologyEx(np.pad(mask.astype(np.uint8), width_px), cv2.MORPH_OPEN, disc)
    opened = cv2.dilate(opened[width_px:-width_px, width_px:-width_px], np.ones((3, 3), np.uint8))
    return np.asarray(mask & (opened == 0))


def _typical_width(mask: BoolArray, hints: BoolArray) -> float:
    """Median width in px along the ridges of the thin part of ``mask``."""
    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    ridge = hints & (depth >= cv2.dilate(depth, np.ones((3, 3), np.uint8)))
    return float(2 * np.median(depth[ridge]) - 1) if ridge.any() else 0.0
