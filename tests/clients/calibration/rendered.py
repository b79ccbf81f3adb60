"""Pictures of a board that are rendered with the lens they will be read with, at poses that are
known."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from dlo_client.calibration import Board
from dlo_client.contracts.cameras import PinholeIntrinsics
from scipy.spatial.transform import Rotation

LENS = PinholeIntrinsics(
    width=640,
    height=480,
    fx=656.0,
    fy=652.0,
    cx=322.1,
    cy=236.9,
    distortion=[-0.12, 0.03, 0.0005, -0.0004],
)
CHARUCO = Board("charuco", 9, 6, 0.03, 0.022)
CHESSBOARD = Board("chessboard", 9, 6, 0.03)
_PX_SQUARE = 60
_FINE = 2
"""Samples a pixel, each way."""


def pose(turn_deg, place) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    made[:3, 3] = place
    return made


T_FLANGE_CAMERA = pose((3.0, -4.0, 92.0), (0.045, -0.02, 0.085))
T_WORLD_BOARD = pose((181.0, 2.0, 30.0), (0.55, 0.1, 0.02))
"""Its print is seen from above: z of a board goes into it."""


def flanges(count: int = 12, seed: int = 0) -> list[np.ndarray]:
    """Of a robot that looks at the middle of the board from around and above."""
    random = np.random.default_rng(seed)
    middle = T_WORLD_BOARD[:3, 3] + T_WORLD_BOARD[:3, :3] @ [0.135, 0.09, 0]
    poses = []
    for k in range(count):
        away = Rotation.from_euler("zx", [360 * k / count, 12 + 22 * (k % 3)], degrees=True).apply(
            [0, 0, 1]
        )
        center = middle + away * random.uniform(0.34, 0.45)
        z = -away
        x = Rotation.from_rotvec(z * random.uniform(-0.9, 0.9)).apply(np.cross([0.0, 1.0, 0.1], z))
        x /= np.linalg.norm(x)
        camera = np.eye(4)
        camera[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        camera[:3, 3] = center
        poses.append(camera @ np.linalg.inv(T_FLANGE_CAMERA))
    return poses


def picture(
    board: Board, T_camera_board: np.ndarray, noise: float = 2.0, seed: int = 0
) -> np.ndarray:
    """(480, 640) gray: the board's print seen through the lens, four samples a pixel, with
    noise."""
    print_px = _print(board)
    rays = _rays()
    inverse = np.linalg.inv(T_camera_board)
    directions, center = rays @ inverse[:3, :3].T, inverse[:3, 3]
    on_board = center[:2] - directions[:, :2] * (center[2] / directions[:, 2])[:, None]
    at = (on_board / board.square_m * _PX_SQUARE + _PX_SQUARE - 0.5).astype(np.float32)
    shape = (LENS.height * _FINE, LENS.width * _FINE)
    seen = cv2.remap(
        print_px,
        at[:, 0].reshape(shape),
        at[:, 1].reshape(shape),
        cv2.INTER_LINEAR,
        borderValue=150,
    ).astype(float)
    small = seen.reshape(LENS.height, _FINE, LENS.width, _FINE).mean(axis=(1, 3))
    grain = np.random.default_rng(seed).normal(0, noise, small.shape)
    return np.clip(small * 0.85 + 15 + grain, 0, 255).astype(np.uint8)


@cache
def _rays() -> np.ndarray:
    """(n, 3) through every sample, of depth 1."""
    xs, ys = np.meshgrid(np.arange(LENS.width * _FINE), np.arange(LENS.height * _FINE))
    pixels = (np.stack([xs, ys], axis=-1).reshape(-1, 1, 2) + 0.5) / _FINE - 0.5
    matrix = np.array([[LENS.fx, 0, LENS.cx], [0, LENS.fy, LENS.cy], [0, 0, 1]])
    ideal = cv2.undistortPoints(pixels, matrix, np.array(LENS.distortion)).reshape(-1, 2)
    return np.column_stack([ideal, np.ones(len(ideal))])


@cache
def _print(board: Board) -> np.ndarray:
    """With a white margin of one square."""
    size = (board.columns * _PX_SQUARE, board.rows * _PX_SQUARE)
    if board.kind == "charuco":
        inner = board.charuco().generateImage(size)
    else:
        rows, columns = np.indices((size[1], size[0])) // _PX_SQUARE
        inner = np.where((rows + columns) % 2 == 0, 0, 255).astype(np.uint8)
    return np.pad(inner, _PX_SQUARE, constant_values=255)
