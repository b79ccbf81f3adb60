"""Poses of the flange in a CSV file: ``picture,x,y,z,r1,r2,r3[,r4]``, a row a picture, as the robot
writes them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlo_client.contracts.frames import EULER_AXES, SCALAR_FIRST, RotationConvention, Unit
from dlo_client.errors import InvalidArgument


def read(path: Path, unit: Unit, convention: RotationConvention) -> dict[str, NDArray[np.float64]]:
    """``T_world_flange`` (4, 4) in meters, by the name of the picture. Raises InvalidArgument
    naming the row."""
    poses: dict[str, NDArray[np.float64]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for number, row in enumerate(csv.reader(file), start=1):
            if not row or row[0].startswith("#") or (number == 1 and _is_head(row)):
                continue
            try:
                numbers = [float(field) for field in row[1:]]
                poses[row[0].strip()] = _pose(numbers, 1.0 if unit == "m" else 1e-3, convention)
            except ValueError as error:
                raise InvalidArgument("flange", f"{path}, row {number}: {error}") from None
    return poses


def _is_head(row: list[str]) -> bool:
    try:
        float(row[1])
    except (IndexError, ValueError):
        return True
    return False


def _pose(
    numbers: list[float], scale: float, convention: RotationConvention
) -> NDArray[np.float64]:
    quaternion = convention in SCALAR_FIRST
    if len(numbers) != 6 + quaternion:
        raise ValueError(
            f"{6 + quaternion} numbers are expected for {convention}, not {len(numbers)}"
        )
    pose = np.eye(4)
    pose[:3, 3] = np.array(numbers[:3]) * scale
    turn = numbers[3:]
    if quaternion:
        pose[:3, :3] = Rotation.from_quat(turn, scalar_first=SCALAR_FIRST[convention]).as_matrix()
    elif convention in ("rotation_vector", "ur"):
        pose[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    else:
        pose[:3, :3] = Rotation.from_euler(EULER_AXES[convention], turn, degrees=True).as_matrix()
    return pose
