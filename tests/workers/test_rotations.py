"""Robot makers' conventions against rotations that are multiplied out by hand."""

from __future__ import annotations

import math
from typing import get_args

import numpy as np
import pytest
from dlo_client.contracts.frames import RotationConvention
from scipy.spatial.transform import Rotation

from workers import rotations

DEGREE = math.pi / 180


def about(axis: str, degrees: float) -> np.ndarray:
    c, s = math.cos(degrees * DEGREE), math.sin(degrees * DEGREE)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


BY_HAND = {
    "kuka_abc": ([30, 20, 10], about("z", 30) @ about("y", 20) @ about("x", 10)),
    "fanuc_wpr": ([10, 20, 30], about("z", 30) @ about("y", 20) @ about("x", 10)),
    "yaskawa": ([10, 20, 30], about("z", 30) @ about("y", 20) @ about("x", 10)),
    "staubli": ([10, 20, 30], about("x", 10) @ about("y", 20) @ about("z", 30)),
    "kawasaki_oat": ([10, 20, 30], about("z", 10) @ about("y", 20) @ about("z", 30)),
    "ur": ([0, 0, 90 * DEGREE], about("z", 90)),
    "rotation_vector": ([math.pi, 0, 0], about("x", 180)),
    "abb": ([math.sqrt(0.5), 0, math.sqrt(0.5), 0], about("y", 90)),
    "quaternion_wxyz": ([math.sqrt(0.5), 0, math.sqrt(0.5), 0], about("y", 90)),
    "quaternion_xyzw": ([0, math.sqrt(0.5), 0, math.sqrt(0.5)], about("y", 90)),
}


def test_every_convention_is_tried():
    assert set(BY_HAND) == set(get_args(RotationConvention))


@pytest.mark.parametrize("convention", BY_HAND)
def test_a_convention_is_what_its_maker_means(convention):
    numbers, matrix = BY_HAND[convention]
    assert np.allclose(rotations.read(numbers, convention), matrix)
    assert np.allclose(rotations.written(matrix, convention), numbers)


@pytest.mark.parametrize("convention", BY_HAND)
def test_there_and_back_also_where_angles_lock(convention):
    turns = [
        *Rotation.random(20, rng=np.random.default_rng(0)).as_matrix(),
        about("y", 90),
        about("y", -90),
        np.eye(3),
    ]
    for matrix in turns:
        numbers = rotations.written(matrix, convention)
        assert len(numbers) == rotations.length(convention)
        assert np.allclose(rotations.read(numbers, convention), matrix, atol=1e-7)


@pytest.mark.parametrize(
    ("numbers", "convention"), [([1, 2], "ur"), ([0, 0, 0, 0], "abb"), ([1, 0, 0, 0], "kuka_abc")]
)
def test_other_counts_and_empty_quaternions_are_refused(numbers, convention):
    with pytest.raises(ValueError, match=r"has|numbers"):
        rotations.read(numbers, convention)


def test_a_pose_in_millimeters():
    pose = rotations.pose_of([100, 200, -300, 0, 0, 90], "mm", "fanuc_wpr")
    assert np.allclose(pose[:3, 3], [0.1, 0.2, -0.3])
    assert rotations.position(pose, "mm") == (100.0, 200.0, -300.0)
    assert rotations.position(pose, "m") == (0.1, 0.2, -0.3)
