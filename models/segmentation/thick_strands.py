"""Strands that are thick at the network's scale are looked at again, from farther away.

A hose as wide as a hand in front of the lens shows the network a wall: it sees both edges as little
as the ends of the piece. From twice as far it is a cable like others.
"""

from __future__ import annotations

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array
from models.segmentation.segment import ForegroundInput, Network, enlarged, probability_at

THICK_PX = 60
"""A strand above this width at the network's scale is wider than most that it learnt from."""
_AROUND = 0.8
"""Widths from the middle of a thick strand within which the view from afar counts."""
_THINNED = 4
"""Every so many pixels are enough to see whether something is thick."""


def look_from_afar(
    image: ByteArray, probability: Float32Array, network: Network, settings: ForegroundInput
) -> Float32Array:
    """(h, w) probability of ``image`` (H, W, 3), seen at a smaller scale: where half that scale
    shows a thick strand the larger of both. It costs nothing where no thick strand is seen, else a
    quarter of the first pass."""
    thinned = np.ascontiguousarray(probability[::_THINNED, ::_THINNED] >= settings.threshold)
    if not _is_long(_middles(thinned, THICK_PX / _THINNED), THICK_PX / _THINNED):
        return probability
    scale = probability.shape[1] / image.shape[1]
    afar = enlarged(probability_at(image, network, settings, scale / 2), probability.shape)
    middles = _middles(afar >= settings.threshold, THICK_PX)
    if not middles.any():
        return probability
    away = cv2.distanceTransform((~middles).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.where(away < _AROUND * THICK_PX, np.maximum(probability, afar), probability)


def _middles(mask: BoolArray, width: float) -> BoolArray:
    """(h, w) what is more than half a ``width`` inside."""
    inside = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(inside > width / 2)


def _is_long(middles: BoolArray, width: float) -> bool:
    """Whether a connected part of ``middles`` (h, w) extends by a ``width``: a strand is at least
    twice as long as it is thick, a heap of thinner ones need not be."""
    _, _, boxes, _ = cv2.connectedComponentsWithStats(middles.view(np.uint8), connectivity=8)
    sides = boxes[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    return bool(np.hypot(*sides.T).max(initial=0.0) >= width)
