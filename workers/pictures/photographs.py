"""Samples to what the networks see of a photograph: RGB with 8 bits a sample."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from workers.pictures.decoding import Samples, Values

_NEARLY_ONE_COLOR = 6
_LOOKED_AT = 1024
_FEW = 2e-4
"""Share of the pixels that may be dead ones."""


def rgb_of(samples: Samples) -> tuple[NDArray[np.uint8], list[str]]:
    """(H, W, 3), and remarks. Transparency is left out."""
    values, remarks = eight_bits(samples.values)
    if samples.alpha is not None and values.min() == values.max():
        values, remarks = (
            samples.alpha,
            [*remarks, "is of one color: its transparency was looked at instead"],
        )
    low, high = _extent(values)
    if high - low <= _NEARLY_ONE_COLOR:
        remarks.append(
            f"is nearly one color (values from {low} to {high} of 255): nothing can be told apart in it"
        )
    rgb = np.repeat(values[:, :, None], 3, axis=2) if values.ndim == 2 else values
    return np.ascontiguousarray(rgb), [*samples.remarks, *remarks]


def eight_bits(values: Values) -> tuple[NDArray[np.uint8], list[str]]:
    """Scaled by the power of two above the maximum: at least 256, or 1 for floats, whose white is
    1."""
    if values.dtype == np.uint8:
        return values, []
    white = white_of(values)
    if values.dtype == np.float32 and white == 1:
        return np.rint(values * 255).astype(np.uint8), []
    scaled = np.minimum(values.astype(np.float32) * np.float32(256 / white), 255).astype(np.uint8)
    if white == 65536:
        return scaled, []
    return scaled, [f"has values up to {values.max():g}: {white:g} was taken as white"]


def white_of(values: Values) -> float:
    """The power of two above the maximum: at least 256 for integers; floats up to 1 have white at
    1."""
    highest = float(values.max())
    if values.dtype == np.float32:
        return 1.0 if highest <= 1 else float(2 ** (int(np.floor(np.log2(highest))) + 1))
    return float(max(256, 2 ** int(highest).bit_length()))


def _extent(values: NDArray[np.uint8]) -> tuple[int, int]:
    """Lowest and highest value of the plane that differs most, of a grid of pixels at most 1024
    wide; a few pixels of another color, such as dead ones, do not count."""
    step = max(1, max(values.shape[:2]) // _LOOKED_AT)
    grid = values[::step, ::step]
    extents = []
    for plane in cv2.split(np.ascontiguousarray(grid)):
        below = np.cumsum(cv2.calcHist([plane], [0], None, [256], [0, 256]))
        few = _FEW * plane.size
        extents.append(
            (
                int(np.searchsorted(below, few, "right")),
                int(np.searchsorted(below, plane.size - few)),
            )
        )
    return max(extents, key=lambda extent: extent[1] - extent[0])
