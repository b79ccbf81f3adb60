"""Square crops in which the DLO stands upright (thesis 2.5.3).

A crop has its own pixels: its middle is the point it was taken at, its rows run across the DLO, its
columns along it. An *offset* is a distance in pixels of the crop along its middle row; positive is
towards ``across_xy``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import ByteArray, Float32Array, FloatArray
from models.geometry.directions import quarter_turned, unit

SIZE = 96
"""Side of a crop, px (thesis 2.5.3)."""
MIDDLE = (SIZE - 1) / 2
"""Column and row of the point that the crop was taken at."""
COMFORTABLE_PX = 24.0
"""A DLO thicker than this is seen in a crop of reduced scale, so that the background shows on both
its sides."""


def across_xy(tangents_xy: FloatArray) -> FloatArray:
    """(n, 2) unit vectors of the crops' rows for (n, 2) tangents: the tangent turned by a
    quarter."""
    return quarter_turned(unit(tangents_xy))


def pixels_per_crop_pixel(width_px: FloatArray) -> FloatArray:
    """(n,) how many pixels of the picture one of the crop is, for DLOs of this width; 1 up to the
    comfortable one."""
    return np.maximum(np.asarray(width_px, np.float64) / COMFORTABLE_PX, 1.0)


def upright_crops(
    image: ByteArray, points_xy: FloatArray, tangents_xy: FloatArray, scales: FloatArray
) -> ByteArray:
    """(n, SIZE, SIZE, 3) crops of ``image`` (H, W, 3) at (n, 2) points with (n, 2) tangents; ``scales`` (n,) as
    :func:`pixels_per_crop_pixel` gives them. What is outside the picture repeats its border."""
    crops = np.empty((len(points_xy), SIZE, SIZE, 3), np.uint8)
    rows = across_xy(tangents_xy)
    for k, (point, row, scale) in enumerate(zip(points_xy, rows, scales, strict=True)):
        column = np.array([row[1], -row[0]])
        matrix = np.stack(
            [row * scale, column * scale, point - MIDDLE * scale * (row + column)], axis=1
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        crops[k] = cv2.warpAffine(
            image, matrix, (SIZE, SIZE), flags=flags, borderMode=cv2.BORDER_REPLICATE
        )
    return crops


def in_crop(
    points_xy: FloatArray, at_xy: FloatArray, tangent_xy: FloatArray, scale: float
) -> FloatArray:
    """(n, 2) points of the picture in pixels of the one crop taken at ``at_xy`` (2,)."""
    row = across_xy(tangent_xy[None])[0]
    column = np.array([row[1], -row[0]])
    out: FloatArray = (points_xy - at_xy) @ np.stack([row, column], axis=1) / scale + MIDDLE
    return out


_BATCH = 64
"""Crops that the network reads at once: memory, not results, depends on it."""


class CorrectorNetwork(Protocol):
    """(n, SIZE, SIZE, 3) crops to (n, SIZE) column probabilities and (n, SIZE) widths."""

    def run(self, *inputs: NDArray) -> tuple[NDArray, ...]: ...


def reader_of(
    network: CorrectorNetwork,
) -> Callable[[ByteArray], tuple[Float32Array, Float32Array]]:
    """The network on any number of crops."""

    def read(crops: ByteArray) -> tuple[Float32Array, Float32Array]:
        parts = [network.run(crops[k : k + _BATCH]) for k in range(0, len(crops), _BATCH)]
        columns, widths = (np.concatenate(part) for part in zip(*parts, strict=True))
        return columns, widths

    return read
