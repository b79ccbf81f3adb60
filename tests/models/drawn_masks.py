"""Masks drawn from lines, for tests of the instance methods."""

from __future__ import annotations

import cv2
import numpy as np


def drawn(*lines: np.ndarray, width: int = 10, shape: tuple[int, int] = (240, 320)) -> np.ndarray:
    """``(H, W)`` bool: the polylines ``(n, 2)`` as strokes."""
    canvas = np.zeros(shape, np.uint8)
    for line in lines:
        cv2.polylines(canvas, [np.rint(np.asarray(line, float) * 16).astype(np.int32)], False, 1, width, shift=4)
    return canvas > 0


def colored(
    *strands: tuple[np.ndarray, tuple[int, int, int]], width: int = 10, shape: tuple[int, int] = (240, 320)
) -> np.ndarray:
    """``(H, W, 3)`` RGB picture of colored strands on gray, later ones on top."""
    canvas = np.full((*shape, 3), 128, np.uint8)
    for line, color in strands:
        cv2.polylines(canvas, [np.rint(np.asarray(line, float) * 16).astype(np.int32)], False, color, width, shift=4)
    return canvas


def circle(center: tuple[float, float], radius: float, start: float = 0.0, stop: float = 2 * np.pi) -> np.ndarray:
    """``(90, 2)`` points of an arc."""
    angles = np.linspace(start, stop, 90)
    return np.array(center) + radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def loop() -> np.ndarray:
    """``(200, 2)`` points of one strand that crosses itself once, near (160, 150)."""
    angles = np.linspace(-0.15, 2 * np.pi + 0.15, 120) + np.pi / 2
    ring = np.array([160.0, 90.0]) + 55 * np.stack((-np.cos(angles), np.sin(angles)), axis=1)
    return np.concatenate(([[40.0, 175.0]], ring, [[280.0, 175.0]]))
