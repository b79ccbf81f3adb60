"""Very large pictures are worked on at a smaller size, so that time and memory stay bounded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.splines import Spline
from models.instances.drawing import draw_labels
from models.instances.scene import Crossing, Endpoint, Instance, Scene

MAX_PIXELS = 4_000_000
_LEAST_SHARE = 0.25
"""Share of a reduced pixel that must be foreground: below a half, so that thin strands survive."""

Method = Callable[[BoolArray, ByteArray | None], Scene]


def at_working_size(mask: BoolArray, image: ByteArray | None, method: Method, max_pixels: int = MAX_PIXELS) -> Scene:
    """What ``method`` finds, in the pixels of ``mask``; it sees at most ``max_pixels``.

    A picture above that is reduced by a whole number; the labels are drawn at full size all the same.
    """
    factor = int(np.ceil(np.sqrt(mask.size / max_pixels)))
    if factor <= 1:
        return method(mask, image)
    size = (max(1, mask.shape[1] // factor), max(1, mask.shape[0] // factor))
    share = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)
    small_image = None if image is None else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    scene = method(share >= 255 * _LEAST_SHARE, None if small_image is None else small_image.astype(np.uint8))
    return _enlarged(scene, mask, np.array(mask.shape[::-1]) / np.array(size))


def _enlarged(scene: Scene, mask: BoolArray, scale: FloatArray) -> Scene:
    """The scene in the pixels of ``mask``; ``scale`` is (x, y)."""

    def moved(xy: FloatArray) -> FloatArray:
        out: FloatArray = (xy + 0.5) * scale - 0.5
        return out

    def moved_point(xy: tuple[float, float]) -> tuple[float, float]:
        x, y = moved(np.array(xy)).tolist()
        return x, y

    def instance(old: Instance) -> Instance:
        return replace(
            old,
            centerline_xy=moved(old.centerline_xy),
            width_px=old.width_px * float(scale.mean()),
            length_px=old.length_px * float(scale.mean()),
            spline=Spline(old.spline.degree, old.spline.knots, moved(old.spline.control_xy)),
            endpoints=tuple(Endpoint(moved_point(e.xy), e.kind) for e in old.endpoints),
        )

    def crossing(old: Crossing) -> Crossing:
        return replace(old, xy=moved_point(old.xy))

    instances = tuple(instance(i) for i in scene.instances)
    crossings = tuple(crossing(c) for c in scene.crossings)
    return Scene(instances, crossings, draw_labels(mask, instances, crossings), scene.timings_ms)
