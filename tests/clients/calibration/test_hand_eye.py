"""Hand-eye calibration on rendered boards: the truth is known."""

from __future__ import annotations

import csv

import cv2
import numpy as np
import pytest
from dlo_client.calibration import BoardView, CalibrationError, calibrate, drift_of, find
from dlo_client.calibration.board_pictures import hand_eye, parsed_board
from dlo_client.calibration.hand_eye import _Lens
from dlo_client.errors import InvalidArgument
from scipy.spatial.transform import Rotation

from tests.clients import curve_samples
from tests.clients.calibration.rendered import (
    CHARUCO,
    CHESSBOARD,
    LENS,
    T_FLANGE_CAMERA,
    T_WORLD_BOARD,
    flanges,
    picture,
    pose,
)


def errors(found: np.ndarray, truth: np.ndarray = T_FLANGE_CAMERA) -> tuple[float, float]:
    """Millimeters and degrees."""
    turn = Rotation.from_matrix(found[:3, :3].T @ truth[:3, :3]).magnitude()
    return 1000 * float(np.linalg.norm(found[:3, 3] - truth[:3, 3])), float(np.degrees(turn))


def corners(
    moved, T: np.ndarray = T_FLANGE_CAMERA, noise_px: float = 0.1, seed: int = 0
) -> list[BoardView]:
    """What a perfect detector would see, with noise."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(1, 9), np.arange(1, 6))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(40)], axis=1) * 0.03
    views = []
    for flange in moved:
        to_camera = np.linalg.inv(flange @ T) @ T_WORLD_BOARD
        seen = _Lens(LENS).project(points @ to_camera[:3, :3].T + to_camera[:3, 3])
        views.append(BoardView(points, seen + random.normal(0, noise_px, seen.shape)))
    return views


@pytest.mark.slow
@pytest.mark.parametrize("board", [CHARUCO, CHESSBOARD], ids=["charuco", "chessboard"])
def test_twelve_rendered_views(board, tmp_path):
    moved = flanges()
    rows = []
    for number, flange in enumerate(moved):
        image = picture(board, np.linalg.inv(flange @ T_FLANGE_CAMERA) @ T_WORLD_BOARD, seed=number)
        cv2.imwrite(str(tmp_path / f"{number:02d}.png"), image)
        quaternion = Rotation.from_matrix(flange[:3, :3]).as_quat()
        rows.append([f"{number:02d}.png", *(1000 * flange[:3, 3]), *quaternion])
    with (tmp_path / "flange.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["picture", "x", "y", "z", "qx", "qy", "qz", "qw"], *rows])
    text = "9x6x0.03x0.022" if board is CHARUCO else "9x6x0.03"
    files = sorted(tmp_path.glob("*.png"))
    found, used, unseen = hand_eye(
        files, tmp_path / "flange.csv", ("mm", "quaternion_xyzw"), (text, "5x5"), LENS, "flange"
    )
    assert used >= 11, unseen
    off_mm, off_deg = errors(found.T)
    assert off_mm < 0.3
    assert off_deg < 0.1
    assert 1000 * found.sigma_m < 0.3
    assert found.residual_px < 0.2


@pytest.mark.slow
def test_the_uncertainty_is_that_of_repeated_calibrations():
    found = [calibrate(corners(flanges(), seed=seed), flanges(), LENS) for seed in range(12)]
    off = np.array([result.T[:3, 3] - T_FLANGE_CAMERA[:3, 3] for result in found])
    spread = float(np.sqrt(np.linalg.eigvalsh(np.cov(off.T))[-1]))
    assert 0.5 < spread / np.mean([result.sigma_m for result in found]) < 2


def test_one_view_with_a_wrong_pose_shows_in_its_residual():
    moved = flanges()
    views = corners(moved)
    moved[4] = moved[4] @ pose((0, 0, 0), (0.003, 0, 0))
    found = calibrate(views, moved, LENS)
    assert int(np.argmax(found.residuals_px)) == 4


def test_a_camera_on_a_stand():
    """The flange holds the board and moves it before the camera."""
    moved = [np.linalg.inv(flange) for flange in flanges()]
    found = calibrate(corners(flanges()), moved, LENS, "stand")
    off_mm, off_deg = errors(found.T)
    assert off_mm < 0.3
    assert off_deg < 0.1


@pytest.mark.parametrize(
    ("moved", "word"),
    [
        (flanges(3), "4 pictures"),
        ([pose((180, 0, 30 * k), (0.5, 0.1, 0.5)) for k in range(6)], "axes"),
        ([pose((180, 0, 0), (0.45 + 0.02 * k, 0.1, 0.5)) for k in range(6)], "axes"),
    ],
)
def test_too_little_movement_is_named(moved, word):
    with pytest.raises(CalibrationError, match=word):
        calibrate(corners(moved), moved, LENS)
    with pytest.raises(CalibrationError, match="as many poses"):
        calibrate(corners(moved), moved[1:], LENS)


def test_a_picture_without_a_board():
    assert find(CHARUCO, np.full((480, 640), 128, np.uint8)) is None
    assert find(CHESSBOARD, np.full((480, 640), 128, np.uint8)) is None


@pytest.mark.parametrize(
    "text", ["7x5", "7x5xa", "2x5x0.03", "7x5x0.03x0.04", "7x5x0.03x0.02x1", "7x5x-1"]
)
def test_what_is_no_board_is_refused(text):
    with pytest.raises(InvalidArgument, match="board"):
        parsed_board(text, "5x5")


def test_drift_is_a_rise_above_what_was_usual():
    def jobs(values):
        return [
            curve_samples.result().model_copy(update={"reprojection_px": value}) for value in values
        ]

    usual = jobs([0.40, 0.45, 0.38, 0.42, 0.41, 0.44])
    assert not drift_of(usual, jobs([0.43, 0.40, 0.46, 0.39, 0.42])).drifted
    assert drift_of(usual, jobs([0.9, 1.1, 0.95, 1.3, 0.8])).drifted
    with pytest.raises(ValueError, match="5 jobs"):
        drift_of(usual, jobs([1.0]))
