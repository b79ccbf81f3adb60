"""The label array of a scene, and its colors. (The picture for people is in ``overlay.py``.)"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.components import runs
from models.geometry.painting import GOLDEN, color_of, stroke
from models.geometry.polylines import around
from models.geometry.sampling import read_nearest
from models.instances.scene import Crossing, Instance

MAX_INSTANCES = int(np.iinfo(np.uint8).max)
"""As many as labels of one byte can name."""
_ROUNDS = (1.6, 1.0, 0.6)
"""Widths of the strokes of a strand, in its own."""
_FIRST_HUE, _OF_A_KIND = 0.02, 12
_STRONG, _WEAKER = np.array([0.9, 1.0]), np.array([0.2, 0.15])
"""Saturation and value of so many labels' colors, and by how much those of the next are less."""


def draw_labels(
    mask: BoolArray,
    instances: Sequence[Instance],
    crossings: Sequence[Crossing],
    shifts: FloatArray | None = None,
) -> ByteArray:
    """``(H, W)`` uint8 labels: every foreground pixel near a centerline belongs to one instance, at
    most 255.

    Strategy: strokes are painted in three rounds, from too wide to too narrow, so that between
    neighbors a pixel goes to the nearer centerline; then the upper strand is painted again over
    each crossing, a width of the lower one to both sides; last, what is not foreground is cleared,
    so that outlines are those of the mask. Where a centerline bridges a gap of the mask, its stroke
    stands in for the foreground.
    ``shifts``: ``(I,)`` pixels by which an instance's edges lie outside the mask; its outline is
    moved outwards by as much.
    """
    labels = np.zeros(mask.shape, dtype=np.uint8)
    for factor in _ROUNDS:
        for number, instance in enumerate(instances, start=1):
            width = max(
                factor * instance.width_px,
                instance.width_px + 3 if factor > 1 and shifts is not None else 0,
            )
            stroke(labels, instance.centerline_xy, number, width)
    for crossing in sorted(crossings, key=lambda c: c.score):
        upper, lower = instances[crossing.over.instance - 1], instances[crossing.under.instance - 1]
        piece = around(upper.centerline_xy, crossing.over.u, lower.width_px)
        stroke(labels, piece, crossing.over.instance, upper.width_px)
    evidence = _bridged(mask, instances)
    if shifts is not None and np.any(shifts):
        evidence = _moved(evidence, labels, shifts)
    labels *= evidence
    return labels


def _moved(evidence: ByteArray, labels: ByteArray, shifts: FloatArray) -> ByteArray:
    """The foreground with the outline of each label moved outwards."""
    by_label = np.zeros(MAX_INSTANCES + 1, np.float32)
    by_label[1 : len(shifts) + 1] = shifts
    # Distances are to pixel centers: the nearest background pixels are at 1.
    outside = cv2.distanceTransform(1 - evidence, cv2.DIST_L2, cv2.DIST_MASK_5)
    return (outside < cv2.LUT(labels, by_label + np.float32(0.5))).view(np.uint8)


def _bridged(mask: BoolArray, instances: Sequence[Instance]) -> ByteArray:
    """``(H, W)`` of 0 and 1: the mask, with the gaps that centerlines cross."""
    bridged = mask.astype(np.uint8)
    for instance in instances:
        outside = read_nearest(mask, instance.centerline_xy) == 0
        for start, stop in runs(outside):
            piece = instance.centerline_xy[max(start - 1, 0) : stop + 1]
            stroke(bridged, piece, 1, instance.width_px)
    return bridged


def palette() -> ByteArray:
    """``(256, 3)`` RGB colors of the labels: 0 black, then hues a golden section apart: neighbors
    differ."""
    colors = [(0, 0, 0)]
    for number in range(MAX_INSTANCES):
        hue, dim = (_FIRST_HUE + number * GOLDEN) % 1.0, number // _OF_A_KIND % 3
        colors.append(color_of(hue, *(_STRONG - dim * _WEAKER)))
    return np.array(colors, np.uint8)
