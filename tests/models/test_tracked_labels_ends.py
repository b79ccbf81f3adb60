"""DLO-WSL past the thesis: strokes farther off than a crop reaches, ends along the DLO, lines up to
the border."""

from __future__ import annotations

import numpy as np
import pytest

from models.tracked_labels.correction import CorrectedStroke, CorrectionParams
from models.tracked_labels.crops import MIDDLE, SIZE
from models.tracked_labels.ends import EndParams, settle_ends
from models.tracked_labels.lines import side_by_side
from models.tracked_labels.outlines import strand_of
from models.tracked_labels.tracked import TrackedParams, label_tracked
from tests.models.test_tracked_labels import WIDTH_M, bright_reader, cameras, drawn, iou, true_line


def test_lines_side_by_side_take_each_column_from_the_nearest_crop():
    """Three crops 24 columns apart: the outer ones reach to their borders."""
    own = np.arange(SIZE, dtype=np.float32)
    whole = side_by_side([own[None] + 1000 * k for k in range(3)], 24)[0]
    assert len(whole) == SIZE + 48
    assert whole[0] == 0
    assert whole[-1] == 2000 + SIZE - 1
    assert whole[48 + 24] == 1000 + 48, "the middle of all is the middle of the second"
    assert whole[48 + 11] == 48 + 11
    assert whole[48 + 13] == 1000 + 48 - 11


def test_one_line_alone_stays_as_it_is():
    line = np.random.default_rng(0).random((3, SIZE)).astype(np.float32)
    np.testing.assert_array_equal(side_by_side([line], 1), line)


def short_sighted(crops):
    """Sees nothing that is more than 8 px from the crop's middle: what is read there is as good as
    chance."""
    dark = crops.copy()
    dark[:, :, : int(MIDDLE) - 8] = 0
    dark[:, :, int(MIDDLE) + 9 :] = 0
    return bright_reader(dark)


@pytest.mark.parametrize(("aside", "found"), [(24, True), (14, True), (0, False)])
def test_a_stroke_farther_off_than_the_corrector_sees_is_found_beside(aside, found):
    views = [drawn(camera, true_line()) for camera in cameras()]
    images, masks = zip(*views, strict=True)
    clicks = true_line()[::33] + np.array([0.0, 0.024, 0.0])
    params = TrackedParams(correction=CorrectionParams(aside_px=aside))
    labels = label_tracked(images, cameras(), [clicks], [WIDTH_M], short_sighted, params)
    assert (np.mean([iou(v.ids > 0, m) for v, m in zip(labels, masks, strict=True)]) > 0.8) == found


@pytest.mark.parametrize(("first", "last"), [(14, 200), (0, 186), (12, 190), (0, 200)])
def test_a_stroke_that_ends_early_is_drawn_to_the_end(first, last):
    views = [drawn(camera, true_line()) for camera in cameras()]
    images, masks = zip(*views, strict=True)
    clicks = true_line()[np.linspace(first, last - 1, 9).astype(int)]
    asked = images, cameras(), [clicks], [WIDTH_M], bright_reader
    overlaps = [
        np.mean(
            [iou(v.ids > 0, m) for v, m in zip(label_tracked(*asked, params), masks, strict=True)]
        )
        for params in (TrackedParams(), TrackedParams(ends=None))
    ]
    assert overlaps[0] > 0.88
    assert overlaps[0] > overlaps[1] + 0.03 * ((first > 0) + (last < 200)), overlaps


def test_a_stroke_that_goes_on_past_the_end_is_cut():
    part = true_line()[15:185]
    views = [drawn(camera, part) for camera in cameras()]
    images, masks = zip(*views, strict=True)
    labels = label_tracked(
        images, cameras(), [true_line()[::11]], [WIDTH_M], bright_reader, TrackedParams()
    )
    assert np.mean([iou(v.ids > 0, m) for v, m in zip(labels, masks, strict=True)]) > 0.9


def straight(count=40, start=100.0):
    """Along y = 60, samples 5 px apart."""
    xy = np.stack([start + 5.0 * np.arange(count), np.full(count, 60.0)], 1)
    return CorrectedStroke(xy, np.zeros(count), np.ones(count), np.full(count, 9.0), np.ones(count))


def bar(first, last, width=9):
    image = np.full((120, 400, 3), 40, np.uint8)
    image[60 - width // 2 : 61 + width // 2, first:last] = (200, 90, 60)
    return image


def test_both_ends_are_put_where_the_picture_has_them():
    (found,) = settle_ends([bar(92, 307)], [straight()], [np.full(40, 9.0)], EndParams())
    assert found.xy[0, 0] == pytest.approx(92, abs=1.5)
    assert found.xy[-1, 0] == pytest.approx(307, abs=1.5)
    np.testing.assert_allclose(found.xy[:, 1], 60)
    assert (np.diff(found.xy[:, 0]) > 0).all()
    np.testing.assert_array_equal(found.xy[10:30], straight().xy[10:30])


def test_a_picture_that_shows_no_difference_moves_no_end():
    plain = np.full((120, 400, 3), 40, np.uint8)
    (found,) = settle_ends([plain], [straight()], [np.full(40, 9.0)], EndParams())
    np.testing.assert_allclose(found.xy, straight().xy)


def test_a_view_that_does_not_show_the_end_takes_the_others_word():
    images = [bar(92, 307), bar(92, 307), np.full((120, 400, 3), 40, np.uint8)]
    found = settle_ends(images, [straight()] * 3, [np.full(40, 9.0)] * 3, EndParams())
    assert found[2].xy[0, 0] == pytest.approx(92, abs=2.5)


def test_a_stroke_whose_end_is_out_of_the_picture_keeps_it():
    gone = straight()
    gone.xy[:3] = np.nan
    (found,) = settle_ends([bar(92, 307)], [gone], [np.full(40, 9.0)], EndParams())
    np.testing.assert_array_equal(found.xy[:10], gone.xy[:10])
    assert found.xy[-1, 0] == pytest.approx(307, abs=1.5)


def test_a_short_stroke_is_left_alone():
    short = straight(6)
    (found,) = settle_ends([bar(92, 307)], [short], [np.full(6, 9.0)], EndParams())
    np.testing.assert_array_equal(found.xy, short.xy)


def test_a_strand_that_goes_on_outside_reaches_the_border():
    stroke = straight(40, start=12.0)
    stroke.offset_px[30:] = np.nan
    stroke.xy[30:] = np.nan
    strand = strand_of(stroke, 0.01, 900.0, (161, 120))
    assert strand is not None
    assert strand.xy[-1].tolist() == [160.0, 60.0], "its last sample in the picture was at 157"
    assert strand.xy[0].tolist() == [12.0, 60.0], "here it ends by itself"
    far = strand_of(stroke, 0.01, 900.0, (400, 120))
    assert far is not None
    assert far.xy[-1, 0] == 157.0, "no border is near: it was lost for another reason"
