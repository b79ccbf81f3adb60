"""Masks drawn from lines, for tests of the instance methods."""

from __future__ import annotations

import cv2
import numpy as np

from models.instances.scene import Scene


def drawn(*lines: np.ndarray, width: int = 10, shape: tuple[int, int] = (240, 320)) -> np.ndarray:
    """``(H, W)`` bool: the polylines ``(n, 2)`` as strokes."""
    canvas = np.zeros(shape, np.uint8)
    for line in lines:
        cv2.polylines(
            canvas,
            [np.rint(np.asarray(line, float) * 16).astype(np.int32)],
            False,
            1,
            width,
            shift=4,
        )
    return canvas > 0


def colored(
    *strands: tuple[np.ndarray, tuple[int, int, int]],
    width: int = 10,
    shape: tuple[int, int] = (240, 320),
) -> np.ndarray:
    """``(H, W, 3)`` RGB picture of colored strands on gray, later ones on top."""
    canvas = np.full((*shape, 3), 128, np.uint8)
    for line, color in strands:
        cv2.polylines(
            canvas,
            [np.rint(np.asarray(line, float) * 16).astype(np.int32)],
            False,
            color,
            width,
            shift=4,
        )
    return canvas


def assert_valid(scene: Scene, mask: np.ndarray) -> None:
    """What holds of every answer to a mask, whatever is in it."""
    assert scene.labels.shape == mask.shape
    assert len(scene.instances) <= 255
    assert scene.labels.max(initial=0) <= len(scene.instances)
    for instance in scene.instances:
        assert np.isfinite(instance.centerline_xy).all()
        assert instance.width_px > 0
        assert 0 <= instance.score <= 1
    for crossing in scene.crossings:
        assert 0.5 <= crossing.score <= 1
        assert 0 <= crossing.existence <= 1
        assert (
            0
            <= min(crossing.over.u, crossing.under.u)
            <= max(crossing.over.u, crossing.under.u)
            <= 1
        )


def circle(
    center: tuple[float, float], radius: float, start: float = 0.0, stop: float = 2 * np.pi
) -> np.ndarray:
    """``(90, 2)`` points of an arc."""
    angles = np.linspace(start, stop, 90)
    return np.array(center) + radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def loop() -> np.ndarray:
    """``(200, 2)`` points of one strand that crosses itself once, near (160, 150)."""
    angles = np.linspace(-0.15, 2 * np.pi + 0.15, 120) + np.pi / 2
    ring = np.array([160.0, 90.0]) + 55 * np.stack((-np.cos(angles), np.sin(angles)), axis=1)
    return np.concatenate(([[40.0, 175.0]], ring, [[280.0, 175.0]]))
