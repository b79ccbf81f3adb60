"""Files to a calibration: pictures of a board, poses of the flange beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlo_client.calibration.boards import Board, find
from dlo_client.calibration.flange_file import read
from dlo_client.calibration.hand_eye import CalibrationError, HandEye, Mount, calibrate
from dlo_client.contracts.cameras import PinholeIntrinsics
from dlo_client.contracts.frames import RotationConvention, Unit
from dlo_client.errors import InvalidArgument


def hand_eye(
    pictures: Sequence[Path],
    flange: Path,
    written: tuple[Unit, RotationConvention],
    board: tuple[str, str],
    intrinsics: PinholeIntrinsics,
    mount: Mount,
) -> tuple[HandEye, int, list[str]]:
    """The calibration, how many pictures it is from, and the names of those that do not show the
    board.

    Raises InvalidArgument.
    """
    poses, layout = read(flange, *written), parsed_board(*board)
    views, flanges, unseen = [], [], []
    for picture in pictures:
        if picture.name not in poses:
            raise InvalidArgument("flange", f"{flange} has no pose of {picture.name}")
        gray = _gray(picture, intrinsics)
        view = find(layout, gray)
        if view is None:
            unseen.append(picture.name)
        else:
            views.append(view)
            flanges.append(poses[picture.name])
    try:
        return calibrate(views, flanges, intrinsics, mount), len(views), unseen
    except CalibrationError as error:
        raise InvalidArgument("pictures", str(error)) from None


def parsed_board(text: str, dictionary: str) -> Board:
    """``7x5x0.03`` is a chessboard, ``7x5x0.03x0.022`` a ChArUco board. Raises InvalidArgument."""
    try:
        columns, rows, square, *marker = text.lower().split("x")
        if marker:
            (width,) = marker
            return Board(
                "charuco", int(columns), int(rows), float(square), float(width), dictionary
            )
        return Board("chessboard", int(columns), int(rows), float(square))
    except ValueError as error:
        raise InvalidArgument(
            "board", f"{text!r} is no board such as 7x5x0.03x0.022: {error}"
        ) from None


def _gray(path: Path, intrinsics: PinholeIntrinsics) -> Any:
    gray = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE)
    if gray is None:
        raise InvalidArgument("pictures", f"{path} is no picture")
    if gray.shape[::-1] != intrinsics.picture_size:
        size = "{} x {}".format(*intrinsics.picture_size)
        raise InvalidArgument(
            "intrinsics", f"are of {size} pixels, {path.name} has {gray.shape[1]} x {gray.shape[0]}"
        )
    return gray
