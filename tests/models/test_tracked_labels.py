"""DLO-WSL: crops, the reading of lines, agreement of corrections, polygons; with a reader that
needs no network."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from models.geometry.cameras import Camera, Intrinsics, look_at
from models.tracked_labels.correction import CorrectionParams, best_path
from models.tracked_labels.crops import MIDDLE, SIZE, in_crop, pixels_per_crop_pixel, upright_crops
from models.tracked_labels.lines import read_lines
from models.tracked_labels.outlines import Strand, draw_ids, find_crossings, outline
from models.tracked_labels.strokes import (
    StrokeError,
    in_robot_frame,
    project_stroke,
    smooth_stroke,
    stretches,
)
from models.tracked_labels.tracked import TrackedParams, label_tracked
from models.tracked_labels.trajectory import Ellipsoid, ellipsoid_poses
from models.weights.inference import default_name, load

INTRINSICS = Intrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
WIDTH_M = 0.01


def test_a_crop_has_its_point_in_the_middle_and_the_dlo_upright():
    image = np.zeros((200, 200, 3), np.uint8)
    cv2.line(image, (20, 20), (180, 180), (255, 255, 255), 7)
    crop = upright_crops(
        image, np.array([[100.0, 100.0]]), np.array([[1.0, 1.0]]), np.array([1.0])
    )[0]
    lit = crop[:, :, 0] > 127
    columns = np.array([np.flatnonzero(row).mean() for row in lit])
    assert np.abs(columns - MIDDLE).max() < 0.6
    assert lit[:, 0].sum() == 0


def test_a_moved_point_shows_the_dlo_at_its_offset():
    """The offset is measured towards the quarter turn of the tangent."""
    image = np.zeros((200, 300, 3), np.uint8)
    image[97:104] = 255  # a horizontal bar around y = 100
    crop = upright_crops(image, np.array([[150.0, 94.0]]), np.array([[1.0, 0.0]]), np.array([1.0]))[
        0
    ]
    assert np.flatnonzero(crop[SIZE // 2, :, 0] > 127).mean() - MIDDLE == pytest.approx(
        6.0, abs=0.6
    )
    local = in_crop(np.array([[150.0, 100.0]]), np.array([150.0, 94.0]), np.array([1.0, 0.0]), 1.0)
    np.testing.assert_allclose(local, [[MIDDLE + 6, MIDDLE]], atol=1e-9)


def test_thick_dlos_are_seen_from_farther_away():
    np.testing.assert_allclose(pixels_per_crop_pixel(np.array([5.0, 24.0, 48.0])), [1, 1, 2])


def test_a_line_is_read_finer_than_a_pixel():
    columns = np.arange(SIZE)
    line = np.exp(-((columns - 61.3) ** 2) / 8)[None].astype(np.float32)
    reading = read_lines(line / line.sum(), np.full((1, SIZE), 9.0, np.float32))
    assert reading.offsets[0] == pytest.approx(61.3 - MIDDLE, abs=0.05)
    assert reading.widths[0] == pytest.approx(9.0)
    assert 0.9 < reading.trust[0] <= 1


def test_a_line_at_the_border_is_read_within_it():
    line = np.zeros((1, SIZE), np.float32)
    line[0, 0] = 1
    assert read_lines(line, np.ones((1, SIZE), np.float32)).offsets[0] == pytest.approx(-MIDDLE)


def test_the_best_path_follows_neighbors_over_a_stronger_decoy():
    evidence = np.full((7, 20), -5.0)
    evidence[:, 6] = 0
    evidence[3, 6], evidence[3, 16] = -2.0, 1.0
    np.testing.assert_array_equal(best_path(evidence, 0.35), [6] * 7)
    assert best_path(evidence, 0.0)[3] == 16


def test_the_trajectory_lies_on_its_ellipsoid_and_looks_at_the_center():
    ellipsoid = Ellipsoid(0.5, 0.4, 0.6, (0.1, -0.2, 0.05))
    poses = ellipsoid_poses(ellipsoid, 3, 8)
    at = (poses[:, :3, 3] - (0.1, -0.2, 0.05)) / (0.5, 0.4, 0.6)
    np.testing.assert_allclose(np.sum(at**2, axis=1), 1)
    camera_z = poses[:, :3, 2]
    towards = np.array([0.1, -0.2, 0.05]) - poses[:, :3, 3]
    np.testing.assert_allclose(
        camera_z, towards / np.linalg.norm(towards, axis=1)[:, None], atol=1e-9
    )
    # Eq. 2.3 by hand: theta 90 degrees, phi 0 is straight along -y.
    np.testing.assert_allclose(
        ellipsoid.at(np.array([np.pi / 2]), np.array([0.0])), [[0.1, -0.6, 0.05]], atol=1e-12
    )
    with pytest.raises(ValueError, match="at least one view"):
        ellipsoid_poses(ellipsoid, 0, 8)


def test_few_clicks_become_an_even_smooth_line():
    turns = np.linspace(0, np.pi / 2, 6)
    clicks = 0.2 * np.stack([np.cos(turns), np.sin(turns), np.zeros(6)], 1)
    line = smooth_stroke(clicks, 0.005, 0.001)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    assert steps.max() < 1.02 * steps.min()
    assert np.abs(np.linalg.norm(line, axis=1) - 0.2).max() < 0.002
    np.testing.assert_allclose(line[[0, -1]], clicks[[0, -1]], atol=0.003)


@pytest.mark.parametrize(
    "points", [[[0, 0, 0]], [[0, 0, 0], [0, 0, 1e-9]], [[0, 0, 0], [np.nan, 0, 1]]]
)
def test_what_is_no_line_is_refused(points):
    with pytest.raises(StrokeError):
        smooth_stroke(np.array(points, float), 0.01, 0.001)


def test_projection_keeps_sample_numbers_and_marks_what_is_seen():
    camera = Camera(
        INTRINSICS, look_at(np.array([0, 0, 0.5]), np.zeros(3), np.array([0.0, -1.0, 0.0]))
    )
    points = np.array([[0, 0, 0], [0.1, 0, 0], [5, 0, 0], [0, 0, 2.0]], float)
    seen = project_stroke(points, camera)
    np.testing.assert_allclose(seen.xy[:2], [[159.5, 119.5], [159.5 + 300 * 0.1 / 0.5, 119.5]])
    assert seen.inside.tolist() == [True, True, False, False]
    assert stretches(np.array([True] * 5 + [False] + [True] * 2)) == [slice(0, 5)]
    tracker = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], float)
    np.testing.assert_allclose(in_robot_frame(np.array([[1.0, 0, 0]]), tracker), [[1, 3, 3]])


def bright_reader(crops):
    """Reads the middle row of a bright DLO on black: its columns, and how many there are."""
    lit = crops[:, SIZE // 2 - 1 : SIZE // 2 + 1, :, 0].mean(1) > 100
    columns = np.arange(SIZE)
    count = lit.sum(1)
    center = np.where(count > 0, (lit * columns).sum(1) / np.maximum(count, 1), MIDDLE)
    line = np.exp(-((columns - center[:, None]) ** 2) / 4) + 1e-4
    line[count == 0] = 1.0
    return (line / line.sum(1, keepdims=True)).astype(np.float32), np.maximum(count, 1)[
        :, None
    ].repeat(SIZE, 1)


def true_line():
    t = np.linspace(-0.12, 0.12, 200)
    return np.stack([t, 0.03 * np.sin(18 * t), np.full(200, 0.01)], 1)


def cameras(count=6):
    return [
        Camera(INTRINSICS, pose)
        for pose in ellipsoid_poses(Ellipsoid(0.3, 0.3, 0.35, (0, 0, 0)), 1, count)
    ]


def drawn(camera, points):
    """A white strand of the right width on black, and its mask."""
    xy, depth = camera.project(points), camera.in_camera(points)[:, 2]
    strand = Strand(xy, WIDTH_M * camera.focal_px / depth, depth)
    mask = draw_ids([strand], 240, 320)
    return np.repeat((mask * 255)[:, :, None], 3, axis=2), mask > 0


@pytest.mark.parametrize("agree", [True, False])
def test_labels_of_wrong_strokes_are_moved_onto_the_dlo(agree):
    """Calibration 6 mm off, a hand 3 mm: the mask is found again in all views."""
    rng = np.random.default_rng(4)
    views = [drawn(camera, true_line()) for camera in cameras()]
    clicks = true_line()[::33] + np.array([0.004, -0.004, 0.003]) + rng.normal(0, 0.002, (7, 3))
    params = TrackedParams(correction=CorrectionParams(agree=agree))
    images, masks = zip(*views, strict=True)
    found = label_tracked(images, cameras(), [clicks], [WIDTH_M], bright_reader, params)
    raw = label_tracked(
        images, cameras(), [clicks], [WIDTH_M], bright_reader, TrackedParams(correct=False)
    )
    after, before = (
        np.mean([iou(v.ids > 0, m) for v, m in zip(vs, masks, strict=True)]) for vs in (found, raw)
    )
    assert before < 0.6
    assert after > (0.85 if agree else 0.8)


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def test_a_covered_view_takes_the_others_word():
    """One view shows nothing: where the DLO must be there follows from the others, not from where
    it was drawn."""
    seen = cameras()
    views = [drawn(camera, true_line()) for camera in seen]
    images = [image for image, _ in views]
    images[2] = np.zeros_like(images[2])
    clicks = true_line()[::33] + np.array([0.0, 0.006, 0.0])
    found = label_tracked(images, seen, [clicks], [WIDTH_M], bright_reader, TrackedParams())
    assert iou(found[2].ids > 0, views[2][1]) > 0.7


def test_width_is_measured_per_view():
    views = [drawn(camera, true_line()) for camera in cameras(3)]
    images = [image for image, _ in views]
    measured, given = (
        label_tracked(
            images,
            cameras(3),
            [true_line()[::20]],
            [0.7 * WIDTH_M],
            bright_reader,
            TrackedParams(measured=m),
        )
        for m in (1.0, 0.0)
    )
    ratio = measured[0].strands[0].width_px.mean() / given[0].strands[0].width_px.mean()
    assert ratio == pytest.approx(1 / 0.7, rel=0.12)


def test_a_strand_out_of_the_picture_is_none():
    black, away = np.zeros((240, 320, 3), np.uint8), true_line()[::20] + np.array([3.0, 0, 0])
    found = label_tracked([black], cameras(1), [away], [WIDTH_M], bright_reader, TrackedParams())
    assert found[0].strands == (None,)
    assert found[0].ids.max() == 0


def test_the_nearer_strand_is_on_top():
    flat = np.linspace(20, 180, 60)
    low = Strand(np.stack([flat, np.full(60, 100.0)], 1), np.full(60, 9.0), np.full(60, 0.5))
    high = Strand(np.stack([np.full(60, 100.0), flat], 1), np.full(60, 9.0), np.full(60, 0.45))
    ids = draw_ids([low, None, high], 200, 200)
    assert (ids[100, 100], ids[100, 50], ids[50, 100]) == (3, 1, 3)
    (crossing,) = find_crossings([low, None, high])
    assert (crossing.over[0], crossing.under[0]) == (2, 0)
    assert crossing.gap_m == pytest.approx(0.05)
    np.testing.assert_allclose(crossing.xy, (100, 100), atol=1e-6)


@pytest.mark.parametrize("width", [5.0, 9.0, 14.0])
def test_a_polygon_is_as_wide_as_its_strand(width):
    line = np.stack([np.linspace(20, 180, 40), 100 + np.linspace(0, 30, 40)], 1)
    strand = Strand(line, np.full(40, width), np.ones(40))
    length = np.hypot(160, 30)
    assert (draw_ids([strand], 200, 200) > 0).sum() == pytest.approx(width * length, rel=0.06)
    assert outline(strand).shape == (80, 2)


def test_the_shipped_corrector_finds_a_bar():
    """Never seen in training: drawn with sharp edges."""
    network = load(default_name("corrector"))
    offsets = np.array([-12.0, -5.0, 0.0, 4.0, 11.0])
    crops = np.full((5, SIZE, SIZE, 3), 150, np.uint8)
    for crop, offset in zip(crops, offsets, strict=True):
        crop[:, round(MIDDLE + offset - 5) : round(MIDDLE + offset + 5)] = (30, 60, 200)
    reading = read_lines(*network.run(crops))
    assert np.abs(reading.offsets - offsets).max() < 1.5
    assert np.abs(np.log(reading.widths / 10)).max() < 0.35
