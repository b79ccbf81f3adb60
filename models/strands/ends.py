"""Where a strand ends, and how wide it is: one rule for every method."""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import BoolArray, Float32Array, FloatArray
from models.geometry.directions import unit
from models.geometry.sampling import read_nearest


def width_of(radii: FloatArray) -> float:
    """Pixels across, edge to edge, of a strand whose distances to the background are ``(n,)``: the
    median counts.

    Distances are to the centers of pixels, so that a line of one pixel has 1.
    """
    return max(1.0, 2 * float(np.median(radii)) - 1)


def beyond(
    line: FloatArray, foreground: BoolArray | Float32Array, most: float, behind: int
) -> FloatArray:
    """``(1, 2)`` the tip of a strand beyond the first of ``(n, 2)`` points, ``(0, 2)`` where that
    is the tip already.

    A medial line ends before its strand does: the tip is the last foreground pixel ahead of it, at
    most ``most`` pixels away, in the direction from the point ``behind`` places farther in.
    """
    step = line[0] - line[min(behind, len(line) - 1)]
    if float(np.hypot(*step)) < 1e-6:
        return line[:0]
    ahead = line[0] + np.arange(1, int(most) + 2)[:, None] * unit(step)
    inside = within(ahead, foreground.shape, 0.0) & (read_nearest(foreground, ahead) > 0)
    reached = int(np.argmin(np.append(inside, False)))
    return ahead[max(reached - 1, 0) : reached]


def within(points_xy: FloatArray, shape: tuple[int, ...], margin: float) -> BoolArray:
    """``(…,)`` which of ``(…, 2)`` points are in the picture and at least ``margin`` pixels from
    its edge."""
    limit = np.array(shape[1::-1]) - 1 - margin
    out: BoolArray = np.logical_and.reduce((points_xy >= margin) & (points_xy <= limit), axis=-1)
    return out
