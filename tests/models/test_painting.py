"""What pictures for people are made of."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry import painting
from models.geometry.sampling import at_scale

RED, BLUE = (200, 0, 0), (0, 0, 200)
ACROSS = np.array([[10.0, 50.0], [90.0, 50.0]])
DOWN = np.array([[50.0, 10.0], [50.0, 90.0]])


def blank() -> np.ndarray:
    return np.zeros((100, 100, 3), np.uint8)


def test_the_upper_line_runs_through_a_crossing_and_the_lower_one_is_interrupted():
    picture = blank()
    for line, color in ((ACROSS, RED), (DOWN, BLUE)):
        painting.centerline(picture, line, color)
    painting.crossing(picture, (ACROSS, 0.5, 8.0), (DOWN, 0.5, 8.0), RED)
    assert picture[50, 50].tolist() == list(RED)
    assert picture[45, 50].tolist() == picture[55, 50].tolist() == list(painting.DARK)
    assert picture[20, 50].tolist() == list(BLUE)


def test_a_tag_is_kept_inside_the_picture():
    picture = blank()
    painting.tag(picture, "12", np.array([99.0, -5.0]), RED)
    rows, columns = np.nonzero(picture.any(axis=2))
    assert (rows.min(), columns.max()) == (0, 99)
    assert (columns.max() - columns.min(), rows.max() - rows.min()) > (10, 8)


def test_places_move_as_pixels_do_when_a_picture_is_reduced():
    picture = blank()
    picture[60:64, 40:44] = 255
    steps = painting.steps_to(picture, 25)
    small = painting.smaller(picture, steps)
    assert (steps, small.shape) == (4, (25, 25, 3))
    assert small[15, 10].tolist() == [255, 255, 255]
    assert at_scale((41.5, 61.5), 1 / steps) == pytest.approx((10, 15))
    assert painting.steps_to(picture, None) == painting.steps_to(picture, 100) == 1


def test_lines_follow_the_size_of_the_picture_and_stay_visible_on_small_ones():
    assert painting.unit_of(np.zeros((50, 60, 3), np.uint8)) == 1.0
    assert painting.unit_of(np.zeros((720, 1280, 3), np.uint8)) == 2.0


@pytest.mark.parametrize(("hue", "rgb"), [(0.0, (255, 0, 0)), (1 / 3, (0, 255, 0))])
def test_colors_by_hue(hue, rgb):
    assert painting.color_of(hue, 1.0, 1.0) == rgb
