"""Cameras: projections with known answers, lenses there and back, poses that are none."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.cameras import Camera, CameraError, Intrinsics, check_pose, epipolar_lines

PLAIN = Intrinsics(640, 480, 600.0, 500.0, 320.0, 240.0)
LENSES = [
    ((-0.2, 0.05, 0.001, -0.002), "plumb_bob"),
    ((-0.2, 0.05, 0.001, -0.002, 0.01), "plumb_bob"),
    ((0.1, -0.05, 0.001, 0.0, 0.01, 0.02, 0.0, 0.0), "rational_polynomial"),
    ((0.02, -0.01, 0.002, 0.0), "equidistant"),
]


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, intrinsics: Intrinsics = PLAIN) -> Camera:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return Camera(intrinsics, pose)


def look_at(center: np.ndarray, target: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Pose at ``center``, ``target`` in the middle of the picture, image y along ``down`` as nearly
    as it can."""
    forward = target - center
    right = np.cross(down, forward)
    axes = [right, np.cross(forward, right), forward]
    pose = np.eye(4)
    pose[:3, :3] = np.stack([axis / np.linalg.norm(axis) for axis in axes], axis=1)
    pose[:3, 3] = center
    return pose


def test_a_point_lands_where_the_pinhole_says():
    xy = at(z=-1.0).project(np.array([[0.1, -0.2, 1.0]]))
    assert xy[0] == pytest.approx([320 + 600 * 0.05, 240 - 500 * 0.1])


def test_what_lies_behind_has_no_place():
    assert np.isnan(at().project(np.array([[0.0, 0.0, -1.0]]))).all()


def test_rays_lead_back_to_the_point():
    camera = Camera(
        PLAIN, look_at(np.array([0.3, -0.4, 0.5]), np.zeros(3), np.array([0.0, 0.0, -1.0]))
    )
    point = np.array([[0.02, 0.03, 0.1]])
    depth = camera.in_camera(point)[:, 2]
    assert camera.center + depth[:, None] * camera.rays(camera.project(point)) == pytest.approx(
        point
    )


@pytest.mark.parametrize(("coefficients", "model"), LENSES)
def test_a_lens_is_undone(coefficients, model):
    camera = at(intrinsics=Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0, coefficients, model))
    ideal = np.array([[320.0, 240.0], [50.0, 60.0], [600.0, 400.0]])
    bent = camera.distort(ideal)
    assert np.abs(bent[1:] - ideal[1:]).max() > 1
    assert camera.undistort(bent) == pytest.approx(ideal, abs=1e-3)


def test_points_lie_on_their_epipolar_lines():
    rng = np.random.default_rng(0)
    first = at(intrinsics=Intrinsics(800, 600, 700.0, 710.0, 390.0, 310.0))
    second = Camera(
        PLAIN,
        look_at(np.array([0.4, 0.1, 0.2]), np.array([0.0, 0.0, 1.0]), np.array([0.1, 1.0, 0.0])),
    )
    points = np.concatenate(
        [rng.uniform(-0.2, 0.2, (20, 2)), rng.uniform(0.8, 1.2, (20, 1))], axis=1
    )
    lines = epipolar_lines(first, second, first.project(points))
    seen = second.project(points)
    assert np.abs(np.sum(lines[:, :2] * seen, axis=1) + lines[:, 2]).max() < 1e-9


def test_looking_at_something_puts_it_in_the_middle():
    camera = Camera(
        PLAIN,
        look_at(np.array([0.3, -0.4, 0.5]), np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])),
    )
    assert camera.project(np.array([[0.1, 0.0, 0.0]]))[0] == pytest.approx([320, 240])
    higher = camera.project(np.array([[0.1, 0.0, 0.1]]))[0]
    assert higher[1] < 240, "what is up in the world is up in the picture"


@pytest.mark.parametrize(
    "change",
    [
        lambda pose: pose[:3] * np.array([[2.0], [1.0], [1.0]]),
        lambda pose: np.diag([1.0, 1.0, -1.0, 1.0]),
        lambda pose: np.where(np.eye(4) > 0, np.nan, pose),
        lambda pose: pose + np.array([[0, 0, 0, 0]] * 3 + [[0, 0, 0.5, 0]]),
        lambda pose: np.eye(3),
    ],
)
def test_what_is_no_rigid_motion_is_refused(change):
    with pytest.raises(CameraError):
        check_pose(change(np.eye(4)))


def test_coefficients_of_another_model_are_refused():
    with pytest.raises(CameraError, match="coefficients"):
        Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0, (0.1, 0.2, 0.3))
