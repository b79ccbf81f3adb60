"""Instance methods see at most so many pixels; their answer is in those of the picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray
from models.instances.drawing import draw_labels
from models.instances.scene import Scene
from models.strands.resolution import reduced

MAX_PIXELS = 4_000_000
"""Larger masks are reduced: time and memory stay bounded, and a DLO is still several pixels
wide."""

Method = Callable[[BoolArray, ByteArray | None], Scene]


def at_working_size(
    mask: BoolArray, image: ByteArray | None, method: Method, max_pixels: int = MAX_PIXELS
) -> Scene:
    """What ``method`` finds, in the pixels of ``mask``; it sees at most ``max_pixels``.

    The labels are drawn at full size all the same. Raises ValueError when the image is of another
    size than the mask.
    """
    binary = np.ascontiguousarray(mask, dtype=bool)
    small = reduced(binary, image, max_pixels)
    if small is None:
        return method(binary, image)
    scene = method(small.mask, small.image).at_scale(small.scale)
    labels = draw_labels(binary, scene.instances, scene.crossings)
    return replace(scene, labels=labels, features={})
