"""Where a strand ends, and how wide it is: one rule for every method."""

from __future__ import annotations

import math

import numpy as np

from models.geometry.arrays import BoolArray, Float32Array, FloatArray
from models.geometry.sampling import middle

_EDGE_PX = 3
"""Nearer to the picture's edge than this and half its width, a strand leaves the picture."""


def width_of(radii: FloatArray) -> float:
    """Pixels across, edge to edge, of a strand whose distances to the background are ``(n,)``: the
    median counts.

    Distances are to the centers of pixels, so that a line of one pixel has 1.
    """
    return max(1.0, 2 * float(middle(radii, axis=0)) - 1)


def beyond(
    line: FloatArray, foreground: BoolArray | Float32Array, most: float, behind: int
) -> FloatArray:
    """``(1, 2)`` the tip of a strand beyond the first of ``(n, 2)`` points, ``(0, 2)`` where that
    is the tip already.

    A medial line ends before its strand does: the tip is the last foreground pixel ahead of it, at
    most ``most`` pixels away, in the direction from the point ``behind`` places farther in.
    """
    x, y = line[0].tolist()
    back_x, back_y = line[min(behind, len(line) - 1)].tolist()
    length = math.hypot(x - back_x, y - back_y)
    if length == 0:
        return line[:0]
    step_x, step_y = (x - back_x) / length, (y - back_y) / length
    height, width = foreground.shape
    reached = 0
    # A tip is a few steps ahead: one at a time they cost a fifth of an array of them all.
    for k in range(1, int(most) + 2):
        at_x, at_y = x + k * step_x, y + k * step_y
        if not (0 <= at_x <= width - 1 and 0 <= at_y <= height - 1):
            break
        if not foreground[round(at_y), round(at_x)]:
            break
        reached = k
    return np.array([[x + reached * step_x, y + reached * step_y]]) if reached else line[:0]


def in_view(
    points_xy: FloatArray, shape: tuple[int, ...], half_width: float | FloatArray
) -> BoolArray:
    """``(…,)`` at which of ``(…, 2)`` points strands end in the picture, not at its edge."""
    return within(points_xy, shape, half_width + _EDGE_PX)


def within(points_xy: FloatArray, shape: tuple[int, ...], margin: float | FloatArray) -> BoolArray:
    """``(…,)`` which of ``(…, 2)`` points are in the picture and at least ``margin`` pixels from
    its edge."""
    limit = np.array(shape[1::-1]) - 1 - margin
    out: BoolArray = np.logical_and.reduce((points_xy >= margin) & (points_xy <= limit), axis=-1)
    return out
