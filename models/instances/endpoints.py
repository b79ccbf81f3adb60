"""What becomes of a DLO at its two ends: free in view, out of the picture, or under another DLO."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.geometry.arrays import FloatArray
from models.instances.scene import Endpoint, EndpointKind, Instance
from models.strands.ends import within

_MARGIN_PX = 3.0
"""Gap that a mask may show between a strand and the one it disappears under."""


def endpoints_of(
    instances: Sequence[Instance], shape: tuple[int, ...]
) -> list[tuple[Endpoint, ...]]:
    """Both endpoints of each instance, in the order of its centerline; none for a closed one.

    ``border``: within a width of the picture's edge. ``hidden``: the stroke reaches that of another
    instance.
    """
    found = []
    for instance in instances:
        others = [other for other in instances if other is not instance]
        ends = () if instance.closed else (instance.centerline_xy[0], instance.centerline_xy[-1])
        found.append(tuple(_endpoint(xy, instance.width_px, others, shape) for xy in ends))
    return found


def _endpoint(
    xy: FloatArray, width: float, others: Sequence[Instance], shape: tuple[int, ...]
) -> Endpoint:
    kind: EndpointKind = "free"
    if not within(xy, shape, max(width, 2.0)):
        kind = "border"
    elif any(_reaches(xy, width, other) for other in others):
        kind = "hidden"
    return Endpoint((float(xy[0]), float(xy[1])), kind)


def _reaches(xy: FloatArray, width: float, other: Instance) -> bool:
    apart = np.hypot(*(other.centerline_xy - xy).T)
    return bool(apart.min() <= (width + other.width_px) / 2 + _MARGIN_PX)
