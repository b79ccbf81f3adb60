"""The patches that Ariadne+'s networks look at (thesis 3.3.6 and 3.3.8), the same in training and
in use."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, Float32Array, FloatArray
from models.geometry.painting import stroke

NODE_PIXELS, CROSSING_PIXELS = 32, 64
_TYPICAL_WIDTH = 12.0
"""Cables up to this width are seen as they are; patches of thicker ones are reduced to it."""

EmbeddingNetwork = Callable[[Float32Array], Float32Array]
"""Patches ``(n, 3, 32, 32)`` to embeddings ``(n, 256)``: TripletNet."""
AboveNetwork = Callable[[Float32Array], Float32Array]
"""Masked patches ``(n, 3, 64, 64)`` to the probability ``(n,)`` that their cable is on top:
CrossNet."""


def reduction(width_px: float) -> float:
    """Picture pixels a patch pixel."""
    return max(1.0, width_px / _TYPICAL_WIDTH)


def patch(picture: ByteArray, center_xy: FloatArray, pixels: int, step: float) -> ByteArray:
    """``(pixels, pixels, …)`` around the center, ``step`` picture pixels apart, 0 outside the
    picture."""
    shift = (pixels - 1) / 2 - center_xy / step
    matrix = np.array([[1 / step, 0, shift[0]], [0, 1 / step, shift[1]]])
    return np.asarray(
        cv2.warpAffine(picture, matrix, (pixels, pixels), flags=cv2.INTER_LINEAR), dtype=np.uint8
    )


def only(crossing: ByteArray, line_xy: FloatArray, width_px: float) -> ByteArray:
    """The patch with everything blackened that is not on the stroke ``line_xy`` (in patch
    pixels)."""
    kept = np.zeros(crossing.shape[:2], np.uint8)
    stroke(kept, line_xy, 1, width_px)
    return crossing * kept[:, :, None]


def to_network(patches: list[ByteArray]) -> Float32Array:
    """``(n, 3, s, s)`` float 0 to 1."""
    stacked = np.stack(patches).transpose(0, 3, 1, 2).astype(np.float32)
    return stacked / np.float32(255.0)
