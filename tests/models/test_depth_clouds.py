"""The camera of an organised point cloud."""

from __future__ import annotations

import numpy as np
import pytest

from models.depth.clouds import off_px, pinhole_of
from models.geometry.cameras import Camera, Intrinsics

WIDE = Intrinsics(64, 48, 70.0, 75.0, 30.5, 25.0)


def cloud(intrinsics: Intrinsics, rng: np.random.Generator) -> np.ndarray:
    camera = Camera(intrinsics, np.eye(4))
    pixels = np.stack(np.meshgrid(np.arange(64.0), np.arange(48.0)), axis=-1).reshape(-1, 2)
    depth = rng.uniform(0.4, 0.8, len(pixels))
    points = camera.rays(camera.undistort(pixels)) * depth[:, None]
    points[rng.random(len(points)) < 0.3] = np.nan
    return points.reshape(48, 64, 3)


def test_intrinsics_follow_from_the_points() -> None:
    rng = np.random.default_rng(0)
    points = cloud(WIDE, rng)
    points[rng.random((48, 64)) < 0.02] += 0.3  # what flies does not count
    found = pinhole_of(points)
    assert found is not None
    assert (found.fx, found.fy, found.cx, found.cy) == pytest.approx((70, 75, 30.5, 25), rel=1e-3)
    assert found.off_px < 0.1
    assert off_px(points, Camera(WIDE, np.eye(4))) < 0.1


def test_points_of_another_camera_are_off() -> None:
    points = cloud(WIDE, np.random.default_rng(1))
    narrow = Intrinsics(64, 48, 140.0, 150.0, 30.5, 25.0)
    assert off_px(points, Camera(narrow, np.eye(4))) > 5


def test_a_distorted_camera_is_told_from_the_pinhole_of_its_points() -> None:
    bent = Intrinsics(64, 48, 70.0, 75.0, 30.5, 25.0, (-0.3, 0.1, 0.0, 0.0))
    points = cloud(bent, np.random.default_rng(2))
    assert off_px(points, Camera(bent, np.eye(4))) < 0.1
    assert off_px(points, Camera(WIDE, np.eye(4))) > 0.5


@pytest.mark.parametrize("kind", ["world", "nothing", "one ray", "mirrored"])
def test_points_that_show_no_camera(kind: str) -> None:
    points = cloud(WIDE, np.random.default_rng(3))
    if kind == "world":
        points = points @ np.array([[0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [0.8, 0.0, -0.6]]) + (
            0.3,
            0.2,
            1.5,
        )
    points[..., 0] *= -1 if kind == "mirrored" else 1
    points[:] = np.nan if kind == "nothing" else (0.1, 0.1, 0.5) if kind == "one ray" else points
    found = pinhole_of(points)
    assert found is None or found.off_px > 1
