"""``python -m models.tracked_labels`` gives a robot the poses of eq. 2.3."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.tracked_labels.__main__ import main

SCENE = ["--center", "0.4", "-0.1", "0.02", "--rings", "2", "--per-ring", "5"]


def poses(capsys, *more: str) -> np.ndarray:
    assert main([*SCENE, *more]) == 0
    return np.array(json.loads(capsys.readouterr().out))


def test_every_camera_looks_at_the_center_from_the_ellipsoid(capsys):
    found = poses(capsys, "--axes", "0.3", "0.2", "0.5")
    assert found.shape == (10, 4, 4)
    away = found[:, :3, 3] - [0.4, -0.1, 0.02]
    assert np.allclose(((away / [0.3, 0.2, 0.5]) ** 2).sum(1), 1)
    ahead = found[:, :3, 2]
    assert np.allclose(ahead, -away / np.linalg.norm(away, axis=1, keepdims=True))


@pytest.mark.parametrize(
    ("form", "turned"),
    [
        ("quaternion_xyzw", Rotation.from_quat),
        ("rotation_vector", Rotation.from_rotvec),
        ("euler_zyx_deg", lambda numbers: Rotation.from_euler("ZYX", numbers, degrees=True)),
    ],
)
def test_a_robots_lines_are_the_same_poses(capsys, form, turned):
    wanted = poses(capsys)
    assert main([*SCENE, "--form", form]) == 0
    rows = np.array(
        [[float(x) for x in row.split()] for row in capsys.readouterr().out.splitlines()]
    )
    assert np.allclose(rows[:, :3], 1000 * wanted[:, :3, 3], atol=1e-5)
    assert np.allclose(turned(rows[:, 3:]).as_matrix(), wanted[:, :3, :3], atol=1e-4)


def test_with_a_calibration_the_flange_is_moved(capsys, tmp_path):
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = (
        Rotation.from_euler("x", 30, degrees=True).as_matrix(),
        (0.05, 0.0, 0.08),
    )
    file = tmp_path / "camera.json"
    file.write_text(json.dumps({"T_flange_camera": mount.tolist()}))
    assert np.allclose(poses(capsys, "--camera", str(file)) @ mount, poses(capsys), atol=1e-7)


@pytest.mark.parametrize(
    "more", [["--axes", "0", "1", "1"], ["--rings", "0"], ["--camera", "nothing.json"]]
)
def test_what_gives_no_poses_is_named(capsys, more):
    assert main([*SCENE, *more]) == 2
    assert "error:" in capsys.readouterr().err
