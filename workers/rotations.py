"""Rotations as robot makers write them, to matrices and back; also poses in their units.

Angles of robot makers are degrees. In SciPy's letters capital axes turn with the body (intrinsic),
small ones stand still (extrinsic). SciPy is imported where it is used: it would take a fifth of the
time in which the service starts.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from dlo_client.contracts.frames import EULER_AXES, SCALAR_FIRST, RotationConvention, Unit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_PER_METER: dict[Unit, float] = {"m": 1.0, "mm": 1000.0}


def length(convention: RotationConvention) -> int:
    """How many numbers a rotation has."""
    return 4 if convention in SCALAR_FIRST else 3


def written(rotation: FloatArray, convention: RotationConvention) -> list[float]:
    """(3, 3) rotation as its numbers; a quaternion's real part is not negative."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(rotation)
    if convention in SCALAR_FIRST:
        return _numbers(turn.as_quat(canonical=True, scalar_first=SCALAR_FIRST[convention]))
    if convention in ("rotation_vector", "ur"):
        return _numbers(turn.as_rotvec())
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # gimbal lock: the third angle is then 0, the rotation right
        return _numbers(turn.as_euler(EULER_AXES[convention], degrees=True))


def read(numbers: Sequence[float], convention: RotationConvention) -> FloatArray:
    """(3, 3) rotation of its numbers. Raises ValueError for another count, or a quaternion of
    length 0."""
    from scipy.spatial.transform import Rotation

    if len(numbers) != length(convention):
        raise ValueError(
            f"a rotation as {convention} has {length(convention)} numbers, not {len(numbers)}"
        )
    if convention in SCALAR_FIRST:
        if np.linalg.norm(numbers) < 0.5:
            raise ValueError("a quaternion has length 1")
        turn = Rotation.from_quat(numbers, scalar_first=SCALAR_FIRST[convention])
    elif convention in ("rotation_vector", "ur"):
        turn = Rotation.from_rotvec(numbers)
    else:
        turn = Rotation.from_euler(EULER_AXES[convention], numbers, degrees=True)
    return np.asarray(turn.as_matrix())


def pose_of(numbers: Sequence[float], unit: Unit, convention: RotationConvention) -> FloatArray:
    """(4, 4) meters, from x, y, z in ``unit`` and the rotation. Raises ValueError."""
    pose = np.eye(4)
    pose[:3, :3] = read(numbers[3:], convention)
    pose[:3, 3] = np.asarray(numbers[:3]) / _PER_METER[unit]
    return pose


def position(pose: FloatArray, unit: Unit) -> tuple[float, float, float]:
    """x, y, z of a (4, 4) pose, in ``unit``, to 0.1 µm."""
    x, y, z = (round(float(c) * _PER_METER[unit], 7 if unit == "m" else 4) for c in pose[:3, 3])
    return x, y, z


def _numbers(values: FloatArray) -> list[float]:
    return [round(float(value), 9) + 0.0 for value in values]
