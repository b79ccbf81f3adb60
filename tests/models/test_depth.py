"""Depth beside a picture: the table, foreground from height, centerlines in meters, the order at
crossings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.depth.curves import MetricCurve, metric_curve
from models.depth.evidence import alone, combined, log_odds
from models.depth.order import covered_stretches, reordered
from models.depth.table import find_table, heights
from models.geometry.cameras import Camera, Intrinsics
from models.instances.section_matching import extract
from models.synthesis.depth_scenes import DepthScene, DepthSceneParams, depth_scene
from models.synthesis.depth_sensor import SensorParams, sensed

SMALL = DepthSceneParams(size=(240, 320), focal_px=450.0, distance_m=0.6, radius_m=0.0025, cables=2)
CLEAN = SensorParams(sigma_m=0.0, holes=0.0, flying=0.0, shadow=0.0, step_m=1e-6)


@pytest.fixture(scope="module")
def scene() -> DepthScene:
    return depth_scene(np.random.default_rng(3), SMALL)


@pytest.fixture(scope="module")
def noisy(scene: DepthScene) -> np.ndarray:
    return sensed(np.random.default_rng(4), scene.depth_m, SensorParams())


def errors(curve: MetricCurve, true: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(curve.points_m[:, None] - true[None], axis=2).min(1))


def test_the_table_is_found_under_cables_noise_and_holes(
    scene: DepthScene, noisy: np.ndarray
) -> None:
    table = find_table(noisy, scene.camera, np.random.default_rng(0))
    assert table is not None
    normal, offset = scene.table
    assert np.degrees(np.arccos(np.clip(table.normal @ normal, -1, 1))) < 0.3
    assert table.offset_m == pytest.approx(offset, abs=0.001)
    assert table.sigma_m == pytest.approx(0.001, rel=0.3)
    assert table.normal @ (scene.camera.center - table.normal * table.offset_m) > 0


@pytest.mark.parametrize("kind", ["empty", "few", "noise", "no depth"])
def test_what_is_no_table(kind: str) -> None:
    rng = np.random.default_rng(0)
    camera = Camera(Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5), np.eye(4))
    depth = {
        "empty": np.full((48, 64), np.nan, np.float32),
        "no depth": np.zeros((48, 64), np.float32),
        "few": np.where(np.arange(48 * 64).reshape(48, 64) < 20, 0.5, np.nan).astype(np.float32),
        "noise": rng.uniform(0.3, 3.0, (48, 64)).astype(np.float32),
    }[kind]
    assert find_table(depth, camera, rng) is None


def test_heights_are_those_of_the_cables(scene: DepthScene) -> None:
    table = find_table(scene.depth_m, scene.camera, np.random.default_rng(0))
    assert table is not None
    above = heights(scene.depth_m, scene.camera, table)
    assert np.abs(above[~scene.mask]).max() < 0.0005
    assert np.percentile(above[scene.mask], 95) > 0.8 * 2 * SMALL.radius_m


def test_depth_alone_shows_the_cables(scene: DepthScene, noisy: np.ndarray) -> None:
    table = find_table(noisy, scene.camera, np.random.default_rng(0))
    assert table is not None
    found = alone(log_odds(heights(noisy, scene.camera, table), table)) > 0.5
    both = np.count_nonzero(found & scene.mask)
    assert 2 * both / (found.sum() + scene.mask.sum()) > 0.75


def test_a_shadow_has_no_height(scene: DepthScene, noisy: np.ndarray) -> None:
    """Color takes a dark strip for a cable; height does not, and it takes nothing from the
    cables."""
    table = find_table(noisy, scene.camera, np.random.default_rng(0))
    assert table is not None
    shadow = np.zeros(scene.mask.shape, bool)
    shadow[20:26, 20:300] = True
    shadow &= ~scene.mask
    color = np.where(scene.mask | shadow, 0.8, 0.05).astype(np.float32)
    seen = combined(color, log_odds(heights(noisy, scene.camera, table), table)) > 0.5
    assert seen[shadow].mean() < 0.15
    assert seen[scene.mask].mean() > 0.8


def test_a_box_is_no_cable() -> None:
    """What is high but wide, and what is far below the table, is not foreground."""
    camera = Camera(Intrinsics(320, 240, 450.0, 450.0, 159.5, 119.5), np.eye(4))
    depth = np.full((240, 320), 0.6, np.float32)
    depth[60:180, 60:200] = 0.55
    table = find_table(depth, camera, np.random.default_rng(0))
    assert table is not None
    found = alone(log_odds(heights(depth, camera, table), table)) > 0.5
    assert found[80:160, 80:180].mean() < 0.05


def test_without_noise_the_curve_is_the_axis(scene: DepthScene) -> None:
    seen = extract(scene.mask)
    for item, number in zip(seen.instances, range(1, 3), strict=True):
        curve = metric_curve(
            item.centerline_xy,
            item.width_px,
            scene.depth_m,
            scene.camera,
            1e-4,
            covered_stretches(seen, number),
        )
        assert curve is not None
        off = min((errors(curve, true) for true in scene.curves_m), key=lambda e: float(np.mean(e)))
        assert np.median(off) < 0.0008
        assert curve.radius_m == pytest.approx(SMALL.radius_m, rel=0.25)


def test_with_noise_holes_and_flying_pixels_the_stated_sigma_holds(
    scene: DepthScene, noisy: np.ndarray
) -> None:
    seen = extract(scene.mask)
    for number, item in enumerate(seen.instances, start=1):
        curve = metric_curve(
            item.centerline_xy,
            item.width_px,
            noisy,
            scene.camera,
            0.001,
            covered_stretches(seen, number),
        )
        assert curve is not None
        off = min((errors(curve, true) for true in scene.curves_m), key=lambda e: float(np.mean(e)))
        assert np.mean(off) < 0.0015
        assert np.mean(off < 3 * curve.sigma_m) > 0.9
        assert curve.measured > 0.8


def test_little_depth_gives_no_curve_and_gaps_a_wider_sigma(scene: DepthScene) -> None:
    item = extract(scene.mask).instances[0]
    nothing = np.full(scene.depth_m.shape, np.nan, np.float32)
    assert metric_curve(item.centerline_xy, item.width_px, nothing, scene.camera, 0.001) is None
    half = sensed(np.random.default_rng(1), scene.depth_m, replace(SensorParams(), holes=0.0))
    middle = item.centerline_xy[len(item.centerline_xy) // 2].astype(int)
    half[middle[1] - 25 : middle[1] + 25, middle[0] - 25 : middle[0] + 25] = np.nan
    curve = metric_curve(item.centerline_xy, item.width_px, half, scene.camera, 0.001)
    assert curve is not None
    assert curve.sigma_m[len(curve.sigma_m) // 2] > 1.1 * np.median(curve.sigma_m)


def test_height_turns_a_wrong_order_over(scene: DepthScene) -> None:
    """The picture says the lower cable is on top, without being sure; the depth knows better."""
    seen = extract(scene.mask)
    assert seen.crossings
    crossing = reordered(seen, scene.depth_m).crossings[0]
    upper = seen.instances[crossing.over.instance - 1]
    x, y = np.rint(crossing.xy).astype(int)
    lines = [scene.camera.project(curve) for curve in scene.curves_m]
    away = [
        np.linalg.norm(upper.centerline_xy[:, None] - line[None, ::20], axis=2).min(1).mean()
        for line in lines
    ]
    assert int(np.argmin(away)) + 1 == scene.owner[y, x]
    assert crossing.score > 0.8
    wrong = replace(crossing, over=crossing.under, under=crossing.over, score=0.7)
    turned = replace(seen, crossings=(wrong,))
    assert reordered(turned, scene.depth_m).crossings[0].over == crossing.over


def test_a_strand_that_bends_sharply_in_height_states_a_wider_sigma() -> None:
    """Over another cable a parabola is too smooth; its error was stated as small as on the
    table."""
    camera = Camera(Intrinsics(320, 60, 450.0, 450.0, 159.5, 29.5), np.eye(4))
    column = np.arange(320.0)
    depth = 0.6 - 0.003 * np.exp(-(((column - 160) / 12) ** 2)) * np.ones((60, 1))
    noisy = (depth + np.random.default_rng(0).normal(0, 1e-3, depth.shape)).astype(np.float32)
    line = np.column_stack([column[10:310], np.full(300, 29.5)])
    curve = metric_curve(line, 3.0, noisy, camera, 1e-3)
    assert curve is not None
    along_ray = np.sqrt(curve.covariance_m2[:, 2, 2])
    assert along_ray[140:160].max() > 1.5 * np.median(along_ray)
