"""What the instances of a picture are to the reconstruction: strands of a view.

Geometry is done in working pixels: a picture whose longest side is more than ``WORKING_SIDE`` is thought of as reduced
to it, camera and centerlines alike, so that distances in pixels mean the same for every camera.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.geometry.arrays import Float32Array
from models.geometry.cameras import Camera
from models.instances.scene import Scene
from models.reconstruction.centering import center
from models.reconstruction.views import Strand, View

WORKING_SIDE = 960
_SHORTEST_PX = 20


def view_of(scene: Scene, probability: Float32Array, camera: Camera, name: str) -> View:
    """The working view of a picture. ``probability``: ``(H, W)`` of foreground, which centers the strands."""
    size = camera.intrinsics
    scale = min(1.0, WORKING_SIDE / max(size.width, size.height))
    strands = []
    for instance in scene.instances:
        centered = center(instance.centerline_xy, instance.width_px, probability)
        if centered is None:
            continue
        xy, width, known = centered
        ideal = camera.undistort(xy)
        if len(ideal) > _SHORTEST_PX and np.isfinite(ideal).all():
            strands.append(Strand.through((ideal + 0.5) * scale - 0.5, width * scale, known))
    return View(_working_camera(camera, scale), tuple(strands), name)


def _working_camera(camera: Camera, scale: float) -> Camera:
    """Without a lens; pixel centers at ``(k + 0.5) s - 0.5``."""
    i = camera.intrinsics
    cx, cy = ((c + 0.5) * scale - 0.5 for c in (i.cx, i.cy))
    width, height = (max(round(side * scale), 1) for side in (i.width, i.height))
    smaller = replace(
        i, width=width, height=height, fx=i.fx * scale, fy=i.fy * scale, cx=cx, cy=cy, distortion=(), model="plumb_bob"
    )
    return replace(camera, intrinsics=smaller)
