"""Polylines, splines and sampling on shapes whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.polylines import arc_lengths, crossing_segments, resample
from models.geometry.sampling import farthest_points, local_maxima, read_nearest, thin_to_grid
from models.geometry.splines import fit_spline
from models.strands.foreground import distance_map


def test_resample_keeps_ends_and_spaces_points_evenly():
    corner = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 10.0]])
    points = resample(corner, 5)
    np.testing.assert_allclose(points, [[0, 0], [10, 0], [20, 0], [30, 0], [30, 10]])
    np.testing.assert_allclose(arc_lengths(points), [0, 10, 20, 30, 40])


def test_arc_lengths_and_resampling_in_three_dimensions():
    """They once took the first two coordinates alone."""
    stair = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0], [3.0, 0.0, 9.0]])
    np.testing.assert_allclose(arc_lengths(stair), [0, 5, 10])
    np.testing.assert_allclose(resample(stair, 3), stair)


def test_crossing_segments_finds_the_one_proper_crossing():
    starts = np.array([[0.0, 0.0], [0.0, 10.0], [20.0, 0.0], [0.0, 30.0]])
    ends = np.array([[10.0, 10.0], [10.0, 0.0], [30.0, 0.0], [30.0, 30.0]])
    hits = crossing_segments(starts, ends)
    assert (hits.first.tolist(), hits.second.tolist()) == ([0], [1])
    np.testing.assert_allclose(hits.xy, [[5, 5]])
    np.testing.assert_allclose([hits.along_first, hits.along_second], [[0.5], [0.5]])


def test_spline_follows_a_circle_arc_within_its_tolerance():
    angles = np.linspace(0, 1.5 * np.pi, 60)
    points = 100 + 50 * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    spline = fit_spline(points, tolerance_px=0.5)
    assert len(spline.knots) == len(spline.control_xy) + spline.degree + 1
    radii = np.hypot(*(spline.at(np.linspace(0, 1, 200)) - 100).T)
    assert np.abs(radii - 50).max() < 0.8
    np.testing.assert_allclose(spline.at(np.array([0.0, 1.0])), points[[0, -1]], atol=0.05)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_spline_of_few_points_goes_through_the_ends(count):
    points = np.stack((np.linspace(0, 30, count), np.linspace(5, 8, count)), axis=1)
    spline = fit_spline(points, tolerance_px=0.5)
    assert spline.degree == min(3, count - 1)
    np.testing.assert_allclose(spline.at(np.array([0.0, 1.0])), points[[0, -1]], atol=0.01)


def test_distance_map_and_maxima_of_a_bar():
    mask = np.zeros((11, 20), bool)
    mask[3:8] = True  # 5 px high, over the whole width: the picture's sides are no background
    distances = distance_map(mask)
    np.testing.assert_allclose(distances[5], 3.0, atol=0.1)
    np.testing.assert_array_equal(
        local_maxima(distances), np.stack((np.arange(20), np.full(20, 5)), axis=1)
    )


@pytest.mark.parametrize(
    "mask",
    [np.ones((4, 4), bool), np.zeros((4, 4), bool), np.zeros((0, 3), bool), np.ones((1, 1), bool)],
)
def test_masks_without_an_outline_have_no_maxima(mask):
    assert local_maxima(distance_map(mask)).shape == (0, 2)


def test_farthest_points_on_a_line_halve_it():
    line = np.stack((np.arange(9), np.zeros(9, int)), axis=1)
    assert farthest_points(line, 5).tolist() == [0, 8, 4, 2, 6]


def test_farthest_points_match_the_plain_definition():
    points = np.unique(np.random.default_rng(1).integers(0, 4000, (300, 2)), axis=0)
    taken = [0]
    for _ in range(39):
        apart = np.min(((points[:, None] - points[taken][None]) ** 2).sum(-1), axis=1)
        taken.append(int(apart.argmax()))
    assert farthest_points(points, 40).tolist() == taken


def test_thin_to_grid_bounds_the_number_and_keeps_few_points():
    many = np.argwhere(np.ones((60, 60)))
    assert 0 < len(thin_to_grid(many, 100)) <= 100
    np.testing.assert_array_equal(thin_to_grid(many[:50], 100), many[:50])


def test_read_nearest_rounds_and_clamps():
    image = np.arange(6, dtype=np.float32).reshape(2, 3)
    np.testing.assert_array_equal(read_nearest(image, np.array([[0.4, 0.6], [9.0, -3.0]])), [3, 2])
