"""Pictures of known cables: what is drawn is where the camera says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.cameras import Camera, Intrinsics
from models.synthesis.arm import SimulatedArm, camera_above, long_cable
from models.synthesis.views import Cable3D, Optics, Scene3D, noise_texture, random_cable, render

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured

SMALL = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
PLAIN = Optics(blur_px=0, noise=0, shadow=0, gloss=0, ambient=1)
GRAY = np.full((64, 64, 3), 120, np.uint8)


def straight(radius: float = 0.004, height: float = 0.02) -> Cable3D:
    y = np.linspace(-0.2, 0.2, 500)
    return Cable3D(
        np.stack([np.zeros(500), y, np.full(500, height)], axis=1), radius, (0.9, 0.1, 0.1)
    )


def shot(scene: Scene3D, camera: Camera, seed: int = 0):
    return render(scene, camera, np.random.default_rng(seed))


def test_a_straight_cable_is_a_band_of_the_right_width():
    """Its axis is at depth 0.23, so half the width is r f / z = 2.6 px."""
    seen = shot(Scene3D((straight(),), GRAY, PLAIN), camera_above(np.zeros(2), 0.25, SMALL))
    columns = np.flatnonzero(seen.ids[60] == 1)
    assert columns.mean() == pytest.approx(79.5, abs=0.3)
    assert len(columns) == pytest.approx(2 * 0.004 * 150 / 0.23, abs=1)
    assert seen.depth_m[60, 79] == pytest.approx(0.23 - 0.004, abs=1e-4)
    assert np.isinf(seen.depth_m[60, 20])


def test_it_moves_with_the_camera_as_the_projection_says():
    scene = Scene3D((straight(),), GRAY, PLAIN)
    for x in (-0.03, 0.02):
        camera = camera_above(np.array([x, 0.0]), 0.25, SMALL)
        expected = camera.project(np.array([[0.0, 0.0, 0.02]]))[0, 0]
        assert np.flatnonzero(shot(scene, camera).ids[60] == 1).mean() == pytest.approx(
            expected, abs=0.6
        )


def test_the_upper_cable_hides_the_lower_one():
    lower = straight(height=0.01)
    upper = replace(lower, points_m=lower.points_m[:, [1, 0, 2]] + np.array([0, 0, 0.02]))
    for cables, on_top in (((lower, upper), 2), ((upper, lower), 1)):
        assert (
            shot(Scene3D(cables, GRAY, PLAIN), camera_above(np.zeros(2), 0.25, SMALL)).ids[60, 80]
            == on_top
        )


def test_the_lens_bends_the_picture():
    lens = replace(SMALL, distortion=(-0.3, 0.1, 0.0, 0.0))
    cable = straight()
    beside = replace(cable, points_m=cable.points_m + np.array([0.07, 0, 0]))
    camera = camera_above(np.zeros(2), 0.25, lens)
    seen = shot(Scene3D((beside,), GRAY, PLAIN), camera)
    x, y = camera.project_to_picture(np.array([[0.07, 0.0, 0.02]]))[0]
    assert np.flatnonzero(seen.ids[round(y)] == 1).mean() == pytest.approx(x, abs=0.5)


def test_equal_seeds_give_equal_pictures():
    rng = np.random.default_rng(3)
    scene = Scene3D((Cable3D(random_cable(rng, 0.3), 0.002, (0.1, 0.2, 0.7)),), noise_texture(rng))
    camera = camera_above(np.zeros(2), 0.25, SMALL)
    assert np.array_equal(shot(scene, camera, 5).rgb, shot(scene, camera, 5).rgb)
    assert not np.array_equal(shot(scene, camera, 5).rgb, shot(scene, camera, 6).rgb)


def test_random_cables_have_their_length_and_run_along_y():
    for seed in range(5):
        points = random_cable(np.random.default_rng(seed), 0.8)
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(0.8, rel=0.05)
        assert np.ptp(points[:, 1]) > np.ptp(points[:, 0])
        assert points[:, 2].min() >= 0.005


def test_a_cable_behind_the_camera_is_refused():
    with pytest.raises(ValueError, match="in front"):
        shot(Scene3D((straight(height=0.5),), GRAY, PLAIN), camera_above(np.zeros(2), 0.25, SMALL))


def test_an_arm_reports_where_it_is_and_takes_the_picture_there():
    arm = long_cable(length_m=0.2)
    pose = np.array(arm.pose())
    pose[0, 3] += 0.05
    arm.move_to(pose.tolist())
    assert arm.pose() == pose.tolist()
    assert arm.picture().startswith(b"\x89PNG")
    assert arm.intrinsics["width"] == 640


def test_encoders_may_be_off():
    scene = Scene3D((straight(),), GRAY, PLAIN)
    camera = camera_above(np.zeros(2), 0.25, SMALL)
    steady, shaky = (
        SimulatedArm(scene, camera, np.random.default_rng(0), jitter_m=j) for j in (0.0, 0.01)
    )
    assert steady.picture() == steady.picture()
    assert shaky.picture() != shaky.picture()
    assert shaky.pose() == camera.T_world_camera.tolist()
