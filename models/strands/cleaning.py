"""A foreground mask without specks, pinholes and slabs."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray

_SPECK_PX = 12.0
_SPECK_WIDTHS = 0.5
"""Smaller patches than this times the squared typical width (and that many pixels) are specks."""
_WIDEST = 1 / 8
"""Foreground wider than this share of the picture's longer side is no DLO."""


@dataclass(frozen=True, eq=False)
class CleanMask:
    """``mask``: ``(H, W)``; ``width_px``: the typical width of what is in it, 0 without any."""

    mask: BoolArray
    width_px: float


def clean(mask: BoolArray, hole_widths: float) -> CleanMask:
    """Specks removed, holes of an area up to ``hole_widths`` squared typical widths filled, slabs removed.

    The typical width is twice the area over the length of all outlines: no single place decides it.
    """
    binary = mask.astype(np.uint8)
    _remove_slabs(binary)
    outlines, tree = cv2.findContours(binary, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if tree is None:
        return CleanMask(binary.view(bool), 0.0)
    is_hole = tree.reshape(-1, 4)[:, 3] >= 0
    areas = np.array([cv2.contourArea(outline) for outline in outlines])
    lengths = np.array([cv2.arcLength(outline, True) for outline in outlines])
    big = areas > _SPECK_PX
    width = 2 * cv2.countNonZero(binary) / max(float(lengths[big].sum()), 1.0) if big.any() else 1.0
    holes = np.flatnonzero(is_hole & (areas <= hole_widths * width**2)).tolist()
    specks = np.flatnonzero(~is_hole & (areas < max(_SPECK_PX, _SPECK_WIDTHS * width**2))).tolist()
    cv2.drawContours(binary, [outlines[k] for k in holes], -1, 1, cv2.FILLED)
    cv2.drawContours(binary, [outlines[k] for k in specks], -1, 0, cv2.FILLED)
    return CleanMask(binary.view(bool), width)


def _remove_slabs(binary: ByteArray) -> None:
    """Clear what is wider than any DLO, in place. Looked for at a quarter of the size: it is large."""
    limit = round(_WIDEST * max(binary.shape, default=0) / 4)
    if limit < 3 or min(binary.shape) < 4 * limit:
        return
    small = cv2.resize(binary, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (limit, limit))
    core = cv2.erode(small, kernel, borderType=cv2.BORDER_REPLICATE)
    if cv2.countNonZero(core):
        slab = cv2.dilate(core, np.ones((round(1.5 * limit), round(1.5 * limit)), np.uint8))
        binary[cv2.resize(slab, binary.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0] = 0
