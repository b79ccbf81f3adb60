"""Masks, their outlines and run lengths, filled polygons and strokes. Nothing here checks what
other tools wrote: that is the work of :mod:`dlo_client.labelling.formats.gate`."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as coco_mask

from dlo_client.contracts import MaskRLE, Point

Mask = NDArray[np.bool_]
Ring = NDArray[np.float64]
"""(n, 2) points."""
_HALF_STEP = 0.25
"""A width that is a whole number should not gain a pixel on either side."""
_BLOCK = 256
"""Points compared with all of another ring at once: bounds the memory."""


def decode(rle: MaskRLE) -> Mask:
    """(H, W) mask."""
    return np.asarray(
        coco_mask.decode({"size": list(rle.size), "counts": rle.counts.encode()}), bool
    )


def encode(mask: Mask) -> MaskRLE:
    rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    return MaskRLE(size=(mask.shape[0], mask.shape[1]), counts=rle["counts"].decode())


def box(rle: MaskRLE) -> tuple[list[float], int]:
    """COCO's bounding box ``[x, y, width, height]`` and the area, px."""
    raw = {"size": list(rle.size), "counts": rle.counts.encode()}
    return [float(v) for v in coco_mask.toBbox(raw)], int(coco_mask.area(raw))


def outlines(mask: Mask) -> list[Ring]:
    """One ring for every connected piece, in continuous coordinates: pixel k reaches from k to k +
    1.

    The ring is a quarter of a pixel inside the pixels' edges: all centers of the piece lie in it
    and no others, and rounded down it runs through the outermost pixels. Readers of either
    convention get the mask back exactly. A hole is joined to its ring by a cut of no width.
    """
    doubled = cv2.resize(mask.astype(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    found, nesting = cv2.findContours(doubled, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    rings = [(np.asarray(c, np.float64).reshape(-1, 2) + 0.5) / 2 for c in found]
    outer = {k: ring for k, ring in enumerate(rings) if nesting[0][k][3] < 0}
    for k, ring in enumerate(rings):
        parent = int(nesting[0][k][3])
        if parent >= 0:
            outer[parent] = _joined(outer[parent], ring)
    return list(outer.values())


def joined(rings: Sequence[Ring]) -> Ring:
    """All rings as one, by cuts of no width: there and back along the same line."""
    whole = rings[0]
    for ring in rings[1:]:
        whole = _joined(whole, ring)
    return whole


def fill(rings: Sequence[Ring], height: int, width: int) -> Mask:
    """The mask of all rings together, in the same coordinates."""
    flat = [ring.ravel().tolist() for ring in rings if len(ring) >= 3]
    if not flat:
        return np.zeros((height, width), bool)
    return np.asarray(
        coco_mask.decode(coco_mask.merge(coco_mask.frPyObjects(flat, height, width))), bool
    )


def stroke(
    points_xy: Sequence[Point], width_px: float, height: int, width: int, closed: bool = False
) -> Mask:
    """A line of this width, for tools that know lines but no masks: pixels whose center is within
    half of it."""
    points = np.asarray(points_xy, np.float64)
    beside = int(np.ceil(width_px / 2)) + 1
    low = np.maximum(np.floor(points.min(0)).astype(int) - beside, -beside)
    high = np.minimum(
        np.ceil(points.max(0)).astype(int) + beside + 1, np.array([width, height]) + beside
    )
    out = np.zeros((height, width), bool)
    if (high <= low).any():
        return out
    away = np.ones((high - low)[::-1], np.uint8)
    fixed = np.rint((points - low) * 16).astype(np.int32)
    cv2.polylines(away, [fixed], closed, 0, 1, cv2.LINE_8, 4)
    near = cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= max(
        0.0, width_px / 2 - _HALF_STEP
    )
    (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, [width, height])
    out[top:bottom, left:right] = near[
        top - low[1] : bottom - low[1], left - low[0] : right - low[0]
    ]
    return out


def mean_width(mask: Mask) -> float:
    """A rough width of a strand, px: four times the mean distance from its pixels to the
    outside."""
    if not mask.any():
        return 1.0
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    cut = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    distance = cv2.distanceTransform(np.pad(cut.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    return max(1.0, float(4 * distance[cut].mean()) - 1.0)


def _joined(ring: Ring, other: Ring) -> Ring:
    """``ring`` with a way to ``other``, around it and back, where the two are nearest."""
    at, j, nearest = 0, 0, np.inf
    for first in range(0, len(ring), _BLOCK):
        distance = ((ring[first : first + _BLOCK, None] - other[None]) ** 2).sum(2)
        if distance.min() < nearest:
            nearest = float(distance.min())
            row, column = np.unravel_index(int(distance.argmin()), distance.shape)
            at, j = first + int(row), int(column)
    around = np.concatenate([other[j:], other[: j + 1]])
    return np.concatenate([ring[: at + 1], around, ring[at:]])
