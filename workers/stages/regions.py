"""Where cables can be, and where they never are: polygons of a request on a picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from dlo_client.contracts.base import Point
from dlo_client.contracts.foreground import Regions
from numpy.typing import NDArray

from workers.stages.outcome import InvalidInput

_SUBPIXEL_BITS = 4


def within(regions: Regions | None, probability: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) ``probability``, 0 where the regions exclude cables. Raises InvalidInput naming
    ``regions``."""
    if regions is None:
        return probability
    size = probability.shape
    allowed = np.ones(size, bool) if not regions.only else _filled(regions.only, size)
    allowed &= ~_filled(regions.never, size)
    if not allowed.any():
        raise InvalidInput("regions", "leave no pixel of the picture", "invalid_regions")
    return np.where(allowed, probability, np.float32(0))


def _filled(polygons: Sequence[Sequence[Point]], size: tuple[int, ...]) -> NDArray[np.bool_]:
    """Each polygon by itself: where two overlap is inside of both."""
    out = np.zeros(size[:2], np.uint8)
    for polygon in polygons:
        corners = np.rint(np.array(polygon) * 2**_SUBPIXEL_BITS).astype(np.int32)
        cv2.fillPoly(out, [corners], 1, shift=_SUBPIXEL_BITS)
    return out > 0
