"""What the instances of a picture are to the reconstruction: strands of a view.

Geometry is done in working pixels: a picture whose longest side is more than ``WORKING_SIDE`` is
thought of as reduced to it, camera and centerlines alike, so that distances in pixels mean the same
for every camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.arrays import ByteArray, Float32Array
from models.geometry.cameras import Camera
from models.geometry.components import runs
from models.geometry.sampling import at_scale
from models.instances.scene import Scene
from models.reconstruction.centering import center
from models.reconstruction.views import Strand, View

WORKING_SIDE = 960
_SHORTEST_PX = 20


@dataclass(frozen=True, eq=False)
class Seen:
    """``view`` in working pixels, ``scale`` of them a pixel; ``ids`` (strands,) of the instances
    that they are."""

    view: View
    scale: float
    ids: list[int]


def view_of(
    scene: Scene, probability: Float32Array, image: ByteArray, camera: Camera, name: str
) -> Seen:
    """The working view of a picture. ``probability``: ``(H, W)`` of foreground; it and the colors
    of ``image``, ``(H, W, 3)``, center the strands."""
    scale = min(1.0, WORKING_SIDE / max(image.shape[:2]))
    strands, ids = strands_of(scene, probability, image, camera, scale)
    working = replace(camera, intrinsics=camera.intrinsics.scaled(scale))
    return Seen(View(working, strands, name), scale, ids)


def strands_of(
    scene: Scene,
    probability: Float32Array,
    image: ByteArray | None,
    camera: Camera,
    scale: float = 1.0,
) -> tuple[tuple[Strand, ...], list[int]]:
    """The instances that are long enough to show a curve, in ideal pixels times ``scale``, and
    their ids."""
    strands, ids = [], []
    for number, instance in enumerate(scene.instances, start=1):
        centered = center(instance.centerline_xy, instance.width_px, probability, image)
        if centered is None:
            continue
        xy, width, known = centered
        ideal = camera.undistort(xy)
        inside = runs(np.asarray(np.isfinite(ideal).all(axis=1)))
        shown = slice(*max(inside, key=lambda run: run[1] - run[0], default=(0, 0)))
        if len(ideal[shown]) > _SHORTEST_PX:
            strands.append(
                Strand.through(at_scale(ideal[shown], scale), width[shown] * scale, known[shown])
            )
            ids.append(number)
    return tuple(strands), ids
