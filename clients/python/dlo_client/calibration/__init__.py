"""Where a camera is on a robot, from pictures of a board and poses of the flange. Needs the extra
``calibrate``."""

from dlo_client.calibration.boards import Board, BoardView, find
from dlo_client.calibration.drift import Drift, drift_of
from dlo_client.calibration.hand_eye import CalibrationError, HandEye, calibrate

__all__ = [
    "Board",
    "BoardView",
    "CalibrationError",
    "Drift",
    "HandEye",
    "calibrate",
    "drift_of",
    "find",
]
