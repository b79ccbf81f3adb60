"""Hand-eye calibration: the camera on the flange, or beside the robot with the board on the flange.

Strategy: each picture gives the pose of the board in the camera. Between two pictures the flange
moves by A and the camera by B, and A X = X B for the X that is sought. Its rotation aligns the axes
of all A with those of all B; its translation then is a linear least squares (Park and Martin 1994).
From there X and the pose of the board are refined together on what was measured, the corners in the
pictures, with a loss that a few bad corners do not pull. The covariance is that of the last step,
with the variance that the residuals show.

Frames: ``T_world_flange`` of the robot, ``X = T_flange_camera`` and ``T_world_board``; for a camera
that stands still the flange carries the board, and ``X = T_world_camera`` and ``T_flange_board``:
the same with inverted flange poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from dlo_client.calibration.boards import BoardView
from dlo_client.contracts.cameras import PinholeIntrinsics

FloatArray = NDArray[np.float64]
Mount = Literal["flange", "stand"]
_LEAST_VIEWS = 4
_LEAST_TURN_RAD = 0.05
"""Between two poses that tell anything of X."""
_LEAST_SPREAD = 0.15
"""Of the axes that the flange turned about: singular value of the second, as a share of the
first."""
_LOSS_PX = 1.0


class CalibrationError(ValueError):
    """The pictures do not determine where the camera is."""


@dataclass(frozen=True)
class HandEye:
    """``T`` (4, 4): ``T_flange_camera``, or ``T_world_camera`` of a camera that stands still.
    ``board`` (4, 4): of the board in the world, or on the flange. ``sigma_m`` and ``sigma_rad``:
    standard deviations in the worst direction. ``residuals_px``: root mean square of each view."""

    T: FloatArray
    board: FloatArray
    sigma_m: float
    sigma_rad: float
    covariance: FloatArray
    """(6, 6) of rotation vector (rad) and translation (m)."""
    residuals_px: list[float]

    @property
    def residual_px(self) -> float:
        """Root mean square over all views."""
        return float(np.sqrt(np.mean(np.square(self.residuals_px))))


def calibrate(
    views: Sequence[BoardView],
    flanges: Sequence[FloatArray],
    intrinsics: PinholeIntrinsics,
    mount: Mount = "flange",
) -> HandEye:
    """From as many poses ``T_world_flange`` (4, 4) as views. Raises CalibrationError naming what is
    missing."""
    if len(views) != len(flanges):
        raise CalibrationError(
            f"{len(views)} pictures need as many poses of the flange, not {len(flanges)}"
        )
    if len(views) < _LEAST_VIEWS:
        raise CalibrationError(
            f"{_LEAST_VIEWS} pictures that show the board are needed, {len(views)} do"
        )
    moved = [
        np.asarray(pose if mount == "flange" else np.linalg.inv(pose), np.float64)
        for pose in flanges
    ]
    lens = _Lens(intrinsics)
    seen = [lens.pose(view) for view in views]
    start = closed_form(moved, seen)
    boards = [pose @ start @ board for pose, board in zip(moved, seen, strict=True)]
    return _refined(views, moved, lens, start, boards[len(boards) // 2])


def closed_form(flanges: Sequence[FloatArray], boards: Sequence[FloatArray]) -> FloatArray:
    """(4, 4) X of A X = X B. Raises CalibrationError where the flange turned about one axis
    only."""
    pairs = []
    for i, j in combinations(range(len(flanges)), 2):
        a, b = np.linalg.inv(flanges[j]) @ flanges[i], boards[j] @ np.linalg.inv(boards[i])
        if np.linalg.norm(_turn(a)) > _LEAST_TURN_RAD:
            pairs.append((a, b))
    axes = np.array([_turn(a) for a, _ in pairs]).reshape(-1, 3)
    spread = np.linalg.svd(axes, compute_uv=False) if len(axes) > 1 else np.zeros(2)
    if spread[0] == 0 or spread[1] < _LEAST_SPREAD * spread[0]:
        raise CalibrationError(
            "turn the flange about two different axes or more between the pictures"
        )
    turn = Rotation.align_vectors(axes, [_turn(b) for _, b in pairs])[0].as_matrix()
    left = np.concatenate([a[:3, :3] - np.eye(3) for a, _ in pairs])
    right = np.concatenate([turn @ b[:3, 3] - a[:3, 3] for a, b in pairs])
    return _pose(turn, np.linalg.lstsq(left, right, rcond=None)[0])


class _Lens:
    """Projects with OpenCV."""

    def __init__(self, intrinsics: PinholeIntrinsics) -> None:
        i = intrinsics
        self._matrix = np.array([[i.fx, 0, i.cx], [0, i.fy, i.cy], [0, 0, 1]])
        self._distortion = np.array(i.distortion or [0.0] * 4)
        self._fisheye = i.lens == "equidistant"

    def project(self, points_m: FloatArray) -> FloatArray:
        """(n, 3) points in the camera's frame to (n, 2) pixels."""
        still = np.zeros(3)
        if self._fisheye:
            xy, _ = cv2.fisheye.projectPoints(
                points_m[:, None], still, still, self._matrix, self._distortion
            )
        else:
            xy, _ = cv2.projectPoints(points_m, still, still, self._matrix, self._distortion)
        return np.asarray(xy, np.float64).reshape(-1, 2)

    def pose(self, view: BoardView) -> FloatArray:
        """(4, 4) of the board in the camera."""
        undistort = cv2.fisheye.undistortPoints if self._fisheye else cv2.undistortPoints
        ideal = undistort(view.picture_xy[:, None], self._matrix, self._distortion)
        found, turn, place = cv2.solvePnP(
            view.points_m, ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
        if not found:
            raise CalibrationError(
                "a picture's corners are not those of a plane, as the camera sees it"
            )
        return _pose(Rotation.from_rotvec(np.ravel(turn)).as_matrix(), np.ravel(place))


def _refined(
    views: Sequence[BoardView],
    flanges: Sequence[FloatArray],
    lens: _Lens,
    start: FloatArray,
    board: FloatArray,
) -> HandEye:
    """Least squares over small turns and shifts of both poses, added on their right."""
    inverse = [np.linalg.inv(pose) for pose in flanges]

    def residuals(step: FloatArray) -> FloatArray:
        camera, placed = np.linalg.inv(_stepped(start, step[:6])), _stepped(board, step[6:])
        errors = []
        for view, flange in zip(views, inverse, strict=True):
            to_camera = camera @ flange @ placed
            points = view.points_m @ to_camera[:3, :3].T + to_camera[:3, 3]
            errors.append(lens.project(points) - view.picture_xy)
        return np.concatenate(errors).ravel()

    found = least_squares(residuals, np.zeros(12), loss="soft_l1", f_scale=_LOSS_PX, x_scale="jac")
    errors = residuals(found.x).reshape(-1, 2)
    information = found.jac.T @ found.jac
    variance = float(np.sum(errors**2)) / max(errors.size - 12, 1)
    covariance = np.linalg.pinv(information)[:6, :6] * variance
    worst = [
        float(np.sqrt(np.linalg.eigvalsh(covariance[k : k + 3, k : k + 3])[-1])) for k in (0, 3)
    ]
    counts = np.cumsum([len(view.points_m) for view in views])[:-1]
    each = [float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) for part in np.split(errors, counts)]
    final = _stepped(start, found.x[:6])
    return HandEye(final, _stepped(board, found.x[6:]), worst[1], worst[0], covariance, each)


def _stepped(pose: FloatArray, step: FloatArray) -> FloatArray:
    return pose @ _pose(Rotation.from_rotvec(step[:3]).as_matrix(), step[3:])


def _turn(pose: FloatArray) -> FloatArray:
    """Rotation vector."""
    return np.asarray(Rotation.from_matrix(pose[:3, :3]).as_rotvec())


def _pose(rotation: FloatArray, place: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    return pose
