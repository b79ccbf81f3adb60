"""Centerlines between the edges of a foreground probability with known edges."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from models.reconstruction.centering import center


def band(
    slope: float = 0.2, offset: float = 40.3, half: float = 4.0, size: tuple[int, int] = (80, 200)
) -> np.ndarray:
    """Probability of a straight strand y = offset + slope x: edges that take two pixels."""
    y, x = np.mgrid[: size[0], : size[1]].astype(float)
    off = (y - offset - slope * x) / np.hypot(1, slope)
    return np.clip((half - np.abs(off)) / 2 + 0.5, 0, 1).astype(np.float32)


def off_line(xy: np.ndarray, slope: float = 0.2, offset: float = 40.3) -> np.ndarray:
    return (xy[:, 1] - offset - slope * xy[:, 0]) / np.hypot(1, slope)


def test_a_line_beside_the_middle_is_moved_onto_it():
    started = np.array([[10.0, 43.5], [90.0, 57.0], [170.0, 76.0 - 2.4]])
    xy, width, known = center(started, 7.0, band())
    assert np.abs(off_line(xy)).max() < 0.1
    assert width == pytest.approx(np.full(len(width), 8.0), abs=0.2)
    assert known.all()


def test_ends_that_run_into_the_border_are_cut():
    probability = band(slope=0.4, offset=2.0)
    xy, _, _ = center(np.array([[0.0, 0.0], [100.0, 42.0], [190.0, 79.0]]), 8.0, probability)
    assert np.abs(off_line(xy, 0.4, 2.0)).max() < 0.15
    assert xy[:, 1].min() > 3


def test_another_strand_across_does_not_pull():
    probability = np.maximum(band(), band(slope=-3.0, offset=400.0))
    xy, _, known = center(np.array([[10.0, 42.3], [180.0, 76.3]]), 8.0, probability)
    assert np.abs(off_line(xy)).max() < 0.3
    assert len(xy) > 140, "the gap at the crossing is bridged"
    crossing = np.abs(xy[:, 0] - 359.7 / 3.2) < 3  # where both lines meet
    assert not known[crossing].any()
    assert known[~(np.abs(xy[:, 0] - 359.7 / 3.2) < 15)].all()


def test_nothing_to_hold_on_to():
    assert (
        center(np.array([[10.0, 42.3], [180.0, 76.3]]), 8.0, np.zeros((80, 200), np.float32))
        is None
    )
    assert (
        center(np.array([[10.0, 42.3], [180.0, 76.3]]), 8.0, np.ones((80, 200), np.float32)) is None
    )


def shadowed(own: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A picture of a level DLO, 5 px wide about y = 40, of a color; beside it, from 42.5 down, its
    soft shadow. And a foreground probability that takes a part of the shadow for the DLO."""
    y = np.arange(80.0)
    inside = np.clip(2.5 - np.abs(y - 40) + 0.5, 0, 1)
    shade = 1 - 0.5 * np.exp(-(((y - 45) / 3.0) ** 2))
    rows = (
        np.array([140.0, 130.0, 120.0]) * shade[:, None] * (1 - inside[:, None])
        + np.array(own) * inside[:, None]
    )
    rows = cv2.GaussianBlur(rows, (1, 9), 0.6)
    picture = np.broadcast_to(np.rint(rows)[:, None], (80, 200, 3)).astype(np.uint8)
    foreground = 1 / (1 + np.exp(-3 * (np.where(y > 40, 3.5, 2.5) - np.abs(y - 40))))
    return np.ascontiguousarray(picture), np.broadcast_to(foreground[:, None], (80, 200)).astype(
        np.float32
    )


@pytest.mark.parametrize("own", [(190, 40, 40), (30, 30, 35)], ids=["red", "black"])
def test_a_soft_shadow_beside_a_dlo_does_not_move_it(own):
    """It moved the edge of the probability in one view and not in the other: 3 mm of depth."""
    picture, probability = shadowed(own)
    line = np.array([[10.0, 40.0], [190.0, 40.0]])
    without, _, _ = center(line, 5.0, probability)
    xy, width, _ = center(line, 5.0, probability, picture)
    assert np.abs(without[:, 1] - 40).mean() > 0.4
    assert np.abs(xy[:, 1] - 40).mean() < 0.15
    assert width.mean() == pytest.approx(5.0, abs=0.4)
