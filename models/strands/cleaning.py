"""A foreground mask without specks, pinholes and slabs."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.strands.foreground import Foreground

_SPECK_PX = 12.0
_SPECK_WIDTHS = 0.5
"""Smaller patches than this times the squared typical width (and that many pixels) are specks."""
_WIDEST, _LEAST_LENGTH_WIDTHS, _REDUCED = 1 / 8, 3.0, 4
"""Foreground wider than this share of the picture's longer side is no DLO, unless it is so many
times longer."""


def clean(mask: BoolArray, hole_widths: float, slit_widths: float = 0.0) -> Foreground:
    """Specks removed, holes filled, slabs removed; the mask that came in is left as it is.

    ``hole_widths``: holes of an area up to this squared, in typical widths, are filled.
    ``slit_widths``: so are those no wider than this, in typical widths: the slits between DLOs of
    one bundle, each of which would make a ring of the skeleton. The typical width is twice the area
    over the length of all outlines: no single place decides it.
    """
    binary = mask.astype(np.uint8)
    _remove_slabs(binary)
    outlines, tree = cv2.findContours(binary, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if tree is None:
        return Foreground.of(binary.view(bool))
    is_hole = tree[0, :, 3] >= 0
    lengths = np.array([cv2.arcLength(outline, True) for outline in outlines])
    areas = _pixels(np.array([cv2.contourArea(outline) for outline in outlines]), lengths, is_hole)
    big = areas > _SPECK_PX
    width = 2 * cv2.countNonZero(binary) / max(float(lengths[big].sum()), 1.0) if big.any() else 1.0
    narrow = 2 * areas < slit_widths * width * lengths
    holes = np.flatnonzero(is_hole & ((areas <= hole_widths * width**2) | narrow)).tolist()
    specks = np.flatnonzero(~is_hole & (areas < max(_SPECK_PX, _SPECK_WIDTHS * width**2))).tolist()
    cv2.drawContours(binary, [outlines[k] for k in holes], -1, 1, cv2.FILLED)
    cv2.drawContours(binary, [outlines[k] for k in specks], -1, 0, cv2.FILLED)
    return Foreground.of(binary.view(bool), width)


def _pixels(areas: FloatArray, lengths: FloatArray, is_hole: BoolArray) -> FloatArray:
    """How many pixels outlines enclose, by Pick's theorem: an outline runs through the middles of
    foreground pixels, so that a line of one pixel encloses no area; the outline of a hole runs
    outside it."""
    out: FloatArray = areas + np.where(is_hole, -0.5, 0.5) * lengths + 1
    return out


def _remove_slabs(binary: ByteArray) -> None:
    """Clear what is wider than any DLO and not long, with its rim, in place. Looked for in a
    smaller mask: it is large."""
    limit = round(_WIDEST * max(binary.shape, default=0) / _REDUCED)
    if limit < 3 or min(binary.shape) < _REDUCED * limit:
        return
    scale = 1 / _REDUCED
    small = cv2.resize(binary, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (limit, limit))
    core = cv2.erode(small, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    if not cv2.countNonZero(core):
        return
    slab = cv2.dilate(core, kernel)
    outlines, _ = cv2.findContours(slab, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    cv2.drawContours(slab, [o for o in outlines if _is_long(o)], -1, 0, cv2.FILLED)
    slab = cv2.dilate(slab, kernel)
    binary[cv2.resize(slab, binary.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0] = 0


def _is_long(outline: NDArray[Any]) -> bool:
    """Whether a slab is a few times longer than wide, as the rectangle of the same area and outline
    is."""
    half = cv2.arcLength(outline, True) / 4
    across = half - np.sqrt(max(half**2 - cv2.contourArea(outline), 0.0))
    return bool(2 * half - across >= _LEAST_LENGTH_WIDTHS * across)
