"""Very large pictures are worked on at a smaller size, so that time and memory stay bounded."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray

_LEAST_SHARE = 0.25
"""Share of a reduced pixel that must be foreground: below a half, so that thin strands survive."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """``mask`` and ``image`` as they are worked on; ``scale`` (x, y): pixels of the picture a
    reduced pixel."""

    mask: BoolArray
    image: ByteArray | None
    scale: FloatArray


def reduced(mask: BoolArray, image: ByteArray | None, max_pixels: int) -> Reduced | None:
    """Both reduced by a whole number to at most so many pixels; None where they are small enough.

    ``mask``: ``(H, W)``; ``image``: ``(H, W, 3)`` or None. Raises ValueError when they are of
    different sizes.
    """
    if image is not None and image.shape != (*mask.shape, 3):
        raise ValueError(f"image {image.shape} does not belong to a mask of {mask.shape}")
    factor = int(np.ceil(np.sqrt(mask.size / max_pixels)))
    if factor <= 1:
        return None
    size = (max(1, mask.shape[1] // factor), max(1, mask.shape[0] // factor))
    full = np.iinfo(np.uint8).max
    share = cv2.resize(mask * np.uint8(full), size, interpolation=cv2.INTER_AREA)
    small = (
        None
        if image is None
        else np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    )
    return Reduced(share >= full * _LEAST_SHARE, small, np.array(mask.shape[::-1]) / np.array(size))
