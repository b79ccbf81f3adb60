"""What becomes of a DLO at its two ends: free in view, out of the picture, or under another DLO."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from models.geometry.arrays import BoolArray, FloatArray, IntArray
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
    owner = [k for k, instance in enumerate(instances) if not instance.closed]
    found: list[tuple[Endpoint, ...]] = [()] * len(instances)
    if not owner:
        return found
    tips = np.array([instances[k].centerline_xy[[0, -1]] for k in owner])
    widths = np.array([instances[k].width_px for k in owner])
    inside = within(tips, shape, np.maximum(widths, 2.0)[:, None, None])
    hidden = _hidden(tips, widths, np.array(owner), instances)
    for k, both, seen, under in zip(
        owner, tips.tolist(), inside.tolist(), hidden.tolist(), strict=True
    ):
        found[k] = tuple(
            Endpoint((x, y), _kind(*known))
            for (x, y), *known in zip(both, seen, under, strict=True)
        )
    return found


def _kind(inside: bool, hidden: bool) -> EndpointKind:
    return "border" if not inside else "hidden" if hidden else "free"


def _hidden(
    tips: FloatArray, widths: FloatArray, owner: IntArray, instances: Sequence[Instance]
) -> BoolArray:
    """``(n, 2)`` which of the ``(n, 2, 2)`` tips of the instances ``owner`` (n,), ``widths`` wide,
    the stroke of another instance reaches."""
    hidden = np.zeros((len(tips), 2), dtype=bool)
    for k, other in enumerate(instances):
        apart = cdist(tips.reshape(-1, 2), other.centerline_xy).min(axis=1).reshape(-1, 2)
        reach = (widths + other.width_px) / 2 + _MARGIN_PX
        hidden |= (apart <= reach[:, None]) & (owner != k)[:, None]
    return hidden
