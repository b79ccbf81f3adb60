"""The first use of all that is slow at its first: tables of color spaces, fonts, decoders, solvers.

It happens while a child warms up, on a drawn picture of two cables that cross, so that no job pays
for it.
"""

from __future__ import annotations

import copy
import hashlib

import cv2
import numpy as np
from dlo_client.contracts import (
    DloObject,
    ImageRef,
    InstancesRequest,
    PlanShapeRequest,
    TopologyRequest,
)

from workers.blobs import FolderBlobs
from workers.stages import instances, plan_shape, topology
from workers.stages.outcome import Outcome, Tools

_SIZE = (360, 640)
_WIDTH_PX = 14
_CABLES = {
    (200, 60, 40): ((40, 60), (250, 120), (600, 300)),
    (40, 90, 210): ((60, 310), (320, 200), (590, 50)),
}
"""RGB of each cable, and the points (x, y) that it passes."""

_PLAN = PlanShapeRequest(
    state_m=[(0.0, 0.0), (0.3, 0.0)],
    target_m=[(0.0, 0.0), (0.2, 0.15)],
    object=DloObject(mass_kg=0.05),
)


def use(tools: Tools) -> list[Outcome]:
    """What came of the drawn picture, as instances and as a harness, with all files; and of a
    plan."""
    data = cv2.imencode(".jpg", _picture()[..., ::-1])[1].tobytes()
    image = ImageRef(id=hashlib.sha256(data).hexdigest())
    own = copy.copy(tools)
    own.blobs = _OnePicture(data)
    seen = (
        instances.run(InstancesRequest(image=image), own),
        topology.run(TopologyRequest(image=image), own),
    )
    return [*seen, plan_shape.run(_PLAN, own)]


def _picture() -> np.ndarray:
    picture = np.full((*_SIZE, 3), 90, np.uint8)
    for color, points in _CABLES.items():
        cv2.polylines(picture, [np.array(points)], isClosed=False, color=color, thickness=_WIDTH_PX)
    return picture


class _OnePicture(FolderBlobs):
    """Nothing that is in a folder or a bucket is needed for it."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def get(self, blob_id: str) -> bytes:
        return self._data
