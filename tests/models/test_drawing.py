"""Label images, their colors, and the overlay."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.splines import fit_spline
from models.instances.drawing import palette
from models.instances.overlay import overlay
from models.instances.published.rt_dlo import extract
from models.instances.scene import Crossing, Instance, Scene, StrandPosition
from tests.models.drawn_masks import colored, drawn

DOWN = np.array([[60.0, 40.0], [260.0, 200.0]])
UP = np.array([[60.0, 200.0], [260.0, 40.0]])


def test_palette_names_every_label_with_another_color():
    colors = palette()
    assert colors.shape == (256, 3)
    assert colors.dtype == np.uint8
    assert colors[0].tolist() == [0, 0, 0]
    assert len(np.unique(colors, axis=0)) == 256
    near = np.abs(np.diff(colors[1:9].astype(int), axis=0)).sum(axis=1)
    assert near.min() > 100


def test_labels_cover_the_mask_and_nothing_else():
    """Strokes as wide as the DLO spill over an uneven outline; labels keep to the foreground."""
    mask = drawn(DOWN, UP)
    mask[::12] &= drawn(DOWN, UP, width=6)[::12]
    labels = extract(mask).labels
    assert not labels[~mask].any()
    assert np.count_nonzero(labels) > 0.97 * np.count_nonzero(mask)


def test_lower_strand_is_interrupted_in_the_labels():
    scene = extract(drawn(DOWN, UP), colored((DOWN, (30, 40, 190)), (UP, (200, 30, 30))))
    (crossing,) = scene.crossings
    along_upper = UP[0] + np.linspace(0.47, 0.53, 9)[:, None] * (UP[1] - UP[0])
    columns, rows = np.rint(along_upper).astype(int).T
    assert set(scene.labels[rows, columns].tolist()) == {crossing.over.instance}


def test_overlay_draws_the_upper_centerline_through_the_crossing():
    image = colored((DOWN, (30, 40, 190)), (UP, (200, 30, 30)))
    scene = extract(drawn(DOWN, UP), image)
    (crossing,) = scene.crossings
    picture = overlay(image, scene)
    assert picture.shape == image.shape
    assert picture.dtype == np.uint8
    x, y = np.rint(crossing.xy).astype(int)
    upper = palette()[crossing.over.instance].astype(int)
    lower = palette()[crossing.under.instance].astype(int)
    shown = picture[y, x].astype(int)
    assert np.abs(shown - upper).sum() < np.abs(shown - lower).sum()


def test_an_id_is_in_the_middle_of_the_longest_piece_without_a_crossing():
    line = np.array([[0.0, 100.0], [1000.0, 100.0]])
    cable = Instance(line, 8.0, 1000.0, False, fit_spline(line, tolerance_px=1.0), (), 1.0)
    places = [StrandPosition(1, u) for u in (0.2, 0.9)]
    crossings = tuple(Crossing((0.0, 0.0), p, StrandPosition(2, 0.5), 1.0) for p in places)
    scene = Scene((cable, cable), crossings, np.zeros((200, 1000), np.uint8))
    picture = overlay(np.zeros((200, 1000, 3), np.uint8), scene)
    box = np.all(picture[92:98] == palette()[1], axis=2).any(axis=0)
    assert np.flatnonzero(box).mean() == pytest.approx(550, abs=20)


def test_overlay_of_nothing_is_the_picture():
    image = np.random.default_rng(0).integers(0, 255, (40, 50, 3), dtype=np.uint8)
    empty = Scene((), (), np.zeros((40, 50), np.uint8))
    result = overlay(image, empty)
    np.testing.assert_array_equal(result, image)
    assert result is not image


def test_overlay_leaves_its_input_alone_and_draws_on_tiny_pictures():
    mask = drawn(np.array([[2.0, 10.0], [38.0, 10.0]]), width=3, shape=(20, 40))
    image = np.zeros((20, 40, 3), np.uint8)
    overlay(image, extract(mask, image))
    assert not image.any()
