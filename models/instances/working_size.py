"""Instance methods see at most so many pixels; their answer is in those of the picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray
from models.geometry.splines import Spline
from models.instances.drawing import draw_labels
from models.instances.scene import Crossing, Endpoint, Instance, Scene
from models.strands.resolution import Reduced, reduced

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
    return (
        method(binary, image)
        if small is None
        else _enlarged(method(small.mask, small.image), binary, small)
    )


def _enlarged(scene: Scene, mask: BoolArray, small: Reduced) -> Scene:
    def instance(old: Instance) -> Instance:
        return replace(
            old,
            centerline_xy=small.enlarged(old.centerline_xy),
            width_px=old.width_px * small.size,
            length_px=old.length_px * small.size,
            spline=Spline(
                old.spline.degree, old.spline.knots, small.enlarged(old.spline.control_xy)
            ),
            endpoints=tuple(Endpoint(small.point(e.xy), e.kind) for e in old.endpoints),
        )

    def crossing(old: Crossing) -> Crossing:
        return replace(old, xy=small.point(old.xy))

    instances = tuple(instance(i) for i in scene.instances)
    crossings = tuple(crossing(c) for c in scene.crossings)
    return Scene(instances, crossings, draw_labels(mask, instances, crossings), scene.timings_ms)
