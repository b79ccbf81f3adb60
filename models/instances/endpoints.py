"""What becomes of a DLO at its two ends: free in view, out of the picture, or under another DLO."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from models.geometry.arrays import BoolArray, FloatArray
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
    if not instances:
        return []
    tips = np.array([instance.centerline_xy[[0, -1]] for instance in instances])
    widths = np.array([instance.width_px for instance in instances])
    inside = within(tips, shape, np.maximum(widths, 2.0)[:, None, None])
    hidden = _hidden(tips, widths, instances)
    return [
        ()
        if instance.closed
        else tuple(
            Endpoint((float(x), float(y)), _kind(seen, under))
            for (x, y), seen, under in zip(tips[k], inside[k], hidden[k], strict=True)
        )
        for k, instance in enumerate(instances)
    ]


def _kind(inside: bool, hidden: bool) -> EndpointKind:
    return "border" if not inside else "hidden" if hidden else "free"


def _hidden(tips: FloatArray, widths: FloatArray, instances: Sequence[Instance]) -> BoolArray:
    """``(I, 2)`` which of the ``(I, 2, 2)`` tips of instances ``widths`` (I,) wide the stroke of
    another one reaches."""
    hidden = np.zeros(tips.shape[:2], dtype=bool)
    for k, other in enumerate(instances):
        apart = cdist(tips.reshape(-1, 2), other.centerline_xy).min(axis=1).reshape(-1, 2)
        reached = apart <= ((widths + other.width_px) / 2 + _MARGIN_PX)[:, None]
        reached[k] = False
        hidden |= reached
    return hidden
