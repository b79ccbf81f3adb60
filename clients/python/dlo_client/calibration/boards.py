"""Boards and their corners in pictures, by OpenCV."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_LEAST_CORNERS = 8
_LARGEST_WINDOW = 11
_FINE = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 0.001)
_DICTIONARIES = {
    "4x4": "DICT_4X4_250",
    "5x5": "DICT_5X5_250",
    "6x6": "DICT_6X6_250",
    "apriltag": "DICT_APRILTAG_36h11",
}


@dataclass(frozen=True)
class Board:
    """``columns`` × ``rows`` squares of ``square_m``; of ``charuco`` the markers are ``marker_m``
    wide."""

    kind: Literal["chessboard", "charuco"]
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = "5x5"

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or self.square_m <= 0:
            raise ValueError("a board has 3 squares or more each way, of a size above 0")
        if self.kind == "charuco" and not 0 < self.marker_m < self.square_m:
            raise ValueError("the markers of a charuco board are smaller than its squares")
        if self.dictionary not in _DICTIONARIES:
            raise ValueError(
                f"no dictionary {self.dictionary!r}; there are {', '.join(_DICTIONARIES)}"
            )

    def charuco(self) -> Any:
        """OpenCV's board."""
        dictionary = cv2.aruco.getPredefinedDictionary(
            getattr(cv2.aruco, _DICTIONARIES[self.dictionary])
        )
        size = (self.columns, self.rows)
        return cv2.aruco.CharucoBoard(size, self.square_m, self.marker_m, dictionary)


@dataclass(frozen=True)
class BoardView:
    """Corners of one picture: ``points_m`` (n, 3) on the board (z = 0), ``picture_xy`` (n, 2)
    pixels."""

    points_m: FloatArray
    picture_xy: FloatArray


def find(board: Board, gray: NDArray[np.uint8]) -> BoardView | None:
    """The board's corners in an (H, W) picture; None where it is not seen, or too little of it.

    A chessboard of equal parity looks the same when it is turned by half; take an odd and an even
    number of squares.
    """
    view = _charuco(board, gray) if board.kind == "charuco" else _chessboard(board, gray)
    return view if view is not None and len(view.points_m) >= _LEAST_CORNERS else None


def _charuco(board: Board, gray: NDArray[np.uint8]) -> BoardView | None:
    made = board.charuco()
    corners, ids, _, _ = cv2.aruco.CharucoDetector(made).detectBoard(gray)
    if ids is None or len(ids) == 0:
        return None
    points = np.asarray(made.getChessboardCorners(), np.float64)[np.ravel(ids)]
    return BoardView(points, np.asarray(corners, np.float64).reshape(-1, 2))


def _chessboard(board: Board, gray: NDArray[np.uint8]) -> BoardView | None:
    inner = (board.columns - 1, board.rows - 1)
    found, corners = cv2.findChessboardCornersSB(gray, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    # Sector-based detection is off by up to half a pixel on slanted boards; the saddle of the gray
    # values is not.
    seen = np.asarray(corners, np.float32).reshape(inner[1], inner[0], 2)
    step = min(float(np.linalg.norm(np.diff(seen, axis=axis), axis=-1).min()) for axis in (0, 1))
    half = max(2, min(_LARGEST_WINDOW, int(step / 4)))
    corners = cv2.cornerSubPix(gray, seen.reshape(-1, 1, 2), (half, half), (-1, -1), _FINE)
    across, down = np.meshgrid(np.arange(inner[0]), np.arange(inner[1]))
    places = (
        np.stack([across.ravel() + 1, down.ravel() + 1, np.zeros(across.size)], axis=1)
        * board.square_m
    )
    return BoardView(places.astype(np.float64), np.asarray(corners, np.float64).reshape(-1, 2))
