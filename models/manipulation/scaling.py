"""Actions and parameters to the ranges that the networks see (thesis 5.4.2), and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.manipulation.simulator import (
    BENDING,
    DAMPING,
    LARGEST_SHIFT_M,
    LARGEST_TURN_RAD,
    MASS_KG,
)

FloatArray = NDArray[np.float64]

MOVE_SCALE = np.array([LARGEST_SHIFT_M, LARGEST_SHIFT_M, LARGEST_TURN_RAD])
_LOW = np.array([MASS_KG[0], BENDING[0], DAMPING[0]])
_SPAN = np.array([MASS_KG[1], BENDING[1], DAMPING[1]]) - _LOW


def scale_move(move: FloatArray) -> FloatArray:
    """(B, 3) dx, dy m and dtheta rad to -1 … 1."""
    return np.asarray(move / MOVE_SCALE)


def scale_rope(rope: FloatArray) -> FloatArray:
    """(…, 3) mass kg, k_b, k_d to 0 … 1."""
    return np.asarray((rope - _LOW) / _SPAN)
