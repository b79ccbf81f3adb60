"""What a picture's foreground is once its strands were looked at: lookalikes go, lost pieces of
cables come.

The network answers pixel by pixel; whether a strand is a cable at all, and whether it can end where
it ends, shows only along it. Strategy: the strands are found by the default method and rated. What
is hardly a cable leaves the foreground. From the free ends of cables it is continued
(``continuation.py``).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.instances.assembly import SHORTEST_WIDTHS
from models.instances.continuation import continued
from models.instances.lookalikes import chances, hardly, rated
from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.strands.foreground import distance_map

_CONTINUED = 0.75
"""Probability of what was not seen but follows."""
_SMALL = 0.02
"""Share of the picture; what fills more is no rest: a network of somebody's own may see other
things than cables."""
_BELOW = 2 / 255
"""Distance from the threshold of what was seen but is none, so that 8 bits keep it below."""


@dataclass(frozen=True, eq=False)
class Settled:
    """``cable`` (H, W) and the ``probability`` (H, W) that agrees with it at the threshold;
    ``scene``: its strands by the default method, those left out that are more likely no cable."""

    cable: BoolArray
    probability: Float32Array
    scene: Scene


def settle(
    image: ByteArray, probability: Float32Array, cable: BoolArray, threshold: float
) -> Settled:
    """``image`` (H, W, 3) RGB, ``probability`` (H, W) that its network sees and what of it counts,
    ``cable`` (H, W)."""
    scene = extract(cable, image)
    likely = chances(scene, probability, cable, image)
    kept = _without_hardly_any(cable, scene, likely)
    added = continued(scene, likely, probability, kept, image)
    settled = kept | added
    agreed = np.where(settled, probability, np.minimum(probability, threshold - _BELOW))
    if added.any():
        agreed[added] = np.maximum(agreed[added], max(_CONTINUED, threshold))
        scene = extract(settled, image)
        likely = chances(scene, agreed, settled, image)
    return Settled(settled, np.asarray(agreed, np.float32), rated(scene, likely))


def _without_hardly_any(cable: BoolArray, scene: Scene, likely: FloatArray) -> BoolArray:
    """``cable`` (H, W) without the instances that are hardly cables and, where no other is left,
    without the pieces that are too short for one: they are the rest of nothing."""
    none = hardly(likely)
    kept = (
        np.asarray(cable & ~np.concatenate(([False], none))[scene.labels]) if none.any() else cable
    )
    return _without_short_pieces(kept) if none.all() else kept


def _without_short_pieces(cable: BoolArray) -> BoolArray:
    """``cable`` (H, W) without small connected pieces that are no longer than a few of their
    widths."""
    count, pieces, boxes, _ = cv2.connectedComponentsWithStats(cable.view(np.uint8), connectivity=8)
    lengths = np.hypot(boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT])
    widths = 2 * np.asarray(ndimage.maximum(distance_map(cable), pieces, np.arange(count)))
    kept = (lengths >= SHORTEST_WIDTHS * widths) | (
        boxes[:, cv2.CC_STAT_AREA] > _SMALL * cable.size
    )
    kept[0] = False
    return np.asarray(kept[pieces])
