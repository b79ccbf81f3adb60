"""Who lies on whom: hand-made curves whose crossings, order and visibility are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from models.synthesis import truth
from models.synthesis.__main__ import truth_record
from models.synthesis.cables import Cable, paint_cables
from models.synthesis.canvas import Canvas
from models.synthesis.looks import Light, flat_look
from models.synthesis.scenes import SceneParams, render_scene
from models.synthesis.stacking import intersections, stack
from models.synthesis.textures import TexturePool

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured

FLAT = Light((0.0, 0.0, 1.0), ambient=1.0, shadow=0.0, softness=0, color=(1.0, 1.0, 1.0))
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def line(
    points: list[tuple[float, float]], heights: tuple[float, float], n: int = 300
) -> np.ndarray:
    t = np.linspace(0, 1, n)
    legs = np.linspace(0, 1, len(points))
    xy = [np.interp(t, legs, [p[i] for p in points]) for i in (0, 1)]
    return np.stack([*xy, np.linspace(*heights, n)], 1).astype(np.float32)


def cable(curve: np.ndarray, color: tuple[float, float, float], half: float = 3.0) -> Cable:
    return Cable(curve, np.full(len(curve), half, np.float32), flat_look(color))


# B falls from 1 to 0 while A stays at 0.5: B is over A at x = 30 and under it at x = 90.
ACROSS = line([(0, 40), (120, 40)], (0.5, 0.5))
ZIGZAG = line([(10, 10), (50, 70), (70, 70), (110, 10)], (1.0, 0.0))
# Down the middle, around to the right and back across itself; the first pass is the higher one.
LOOP = line([(40, 5), (40, 75), (75, 75), (75, 40), (5, 40)], (1.0, 0.0), n=400)


def painted(cables: list[Cable], light: Light = FLAT) -> tuple[Canvas, truth.Crossing]:
    canvas = Canvas(torch.full((3, 80, 120), 0.5))
    plan = paint_cables(canvas, cables, light, np.random.default_rng(0))
    return canvas, plan


def test_crossings_are_found_where_the_lines_meet():
    first, second = sorted(m.xy for m in intersections([ACROSS, ZIGZAG]))
    assert first == pytest.approx((30, 40), abs=0.3)
    assert second == pytest.approx((90, 40), abs=0.3)


def test_neighbors_side_by_side_do_not_cross():
    assert intersections([ACROSS, ACROSS + np.float32([0, 7, 0])]) == []
    assert intersections([]) == []


def test_a_cable_passes_over_another_and_then_under_it():
    canvas, plan = painted([cable(ACROSS, RED), cable(ZIGZAG, BLUE)])
    left, right = sorted(truth.crossings(plan, canvas.ids.numpy()), key=lambda c: c.xy)
    assert (left.over, left.under) == (2, 1)
    assert (right.over, right.under) == (1, 2)
    assert canvas.rgb[:, 40, 30].tolist() == pytest.approx([0, 0, 1], abs=0.01)
    assert canvas.rgb[:, 40, 90].tolist() == pytest.approx([1, 0, 0], abs=0.01)
    assert left.visible
    assert right.visible


def test_a_self_crossing_shows_the_pass_that_lies_higher():
    """The first pass along the curve is on top: it must not be painted over by the later one."""
    curve = LOOP.copy()
    canvas, plan = painted([cable(curve, RED)])
    (crossing,) = truth.crossings(plan, canvas.ids.numpy())
    assert crossing.xy == pytest.approx((40, 40), abs=0.3)
    assert crossing.over == crossing.under == 1
    assert crossing.over_sample < crossing.under_sample
    _, upside_down = painted([cable(curve * np.float32([1, 1, -1]), RED)])
    (turned,) = truth.crossings(upside_down, canvas.ids.numpy())
    assert turned.over_sample > turned.under_sample


def test_heights_agree_with_the_order_at_every_crossing():
    rng = np.random.default_rng(5)
    curves = [
        line([tuple(rng.uniform(0, 100, 2)) for _ in range(6)], (rng.random(), rng.random()))
        for _ in range(4)
    ]
    plan = stack(curves, [2.0] * 4)
    assert len(plan.meetings) > 10
    for meeting in plan.meetings:
        (over, i), (under, j) = plan.over_and_under(meeting)
        assert plan.heights[over][i] >= plan.heights[under][j]


def test_the_lower_strand_is_hidden_at_a_crossing_and_seen_elsewhere():
    canvas, plan = painted([cable(ACROSS, RED), cable(ZIGZAG, BLUE)])
    seen = truth.visible(plan, ACROSS, 0, canvas.ids.numpy())
    near = np.abs(ACROSS[:, 0] - 30) < 2
    assert not seen[near].any()
    assert seen[np.abs(ACROSS[:, 0] - 60) < 10].all()
    assert seen[np.abs(ACROSS[:, 0] - 90) < 10].all()
    assert not truth.visible(plan, ACROSS - np.float32([500, 0, 0]), 0, canvas.ids.numpy()).any()


def test_what_lies_over_a_crossing_hides_it():
    canvas, plan = painted([cable(ACROSS, RED), cable(ZIGZAG, BLUE)])
    canvas.box((30, 40), (8, 8), 0.0, (0, 0, 0), covers=True)
    left, right = sorted(truth.crossings(plan, canvas.ids.numpy()), key=lambda c: c.xy)
    assert (left.visible, right.visible) == (False, True)


def test_the_upper_strand_darkens_the_lower_one_and_never_itself():
    light = replace(FLAT, shadow=0.6, contact=0.5)
    canvas, _ = painted([cable(ACROSS, RED), cable(ZIGZAG, BLUE)], light)
    plain, _ = painted([cable(ACROSS, RED), cable(ZIGZAG, BLUE)])
    on_lower = canvas.rgb[0, 40, 22:27] < plain.rgb[0, 40, 22:27] - 0.05
    assert bool(on_lower.any())
    own = canvas.rgb[2, 40, 30], canvas.rgb[0, 40, 90]
    assert [float(v) for v in own] == pytest.approx([1, 1], abs=0.01)
    assert bool((canvas.rgb[:, 46:48, 60] < 0.5).all() or (canvas.rgb[:, 44:46, 60] < 0.5).all())


def test_scenes_carry_consistent_crossings_and_json():
    """At a visible crossing the picture of ids shows the cable that is said to be on top."""
    total = 0
    for seed in range(12):
        params = SceneParams((96, 160), empty_share=0.0)
        scene = render_scene(np.random.default_rng(seed), params, TexturePool(()))
        for crossing in scene.crossings:
            x, y = (round(v) for v in crossing.xy)
            assert not crossing.visible or scene.ids[y, x] == crossing.over
            total += crossing.visible
            upper = scene.centerlines[crossing.over - 1][crossing.over_sample]
            lower = scene.centerlines[crossing.under - 1][crossing.under_sample]
            assert np.abs(upper[:2] - crossing.xy).max() < 2
            assert upper[2] >= lower[2]
        record = json.loads(json.dumps(truth_record(scene)))
        assert len(record["crossings"]) == len(scene.crossings)
        assert len(record["visible"][0]) == len(record["centerlines_xyz"][0])
    assert total > 5


def test_the_camera_sees_the_table_where_the_picture_shows_it():
    camera = truth.random_camera(np.random.default_rng(0), (192, 320))
    focal, distance = camera.K[0, 0], camera.T_camera_world[2, 3]
    corner = np.float32([[-159.5 * distance / focal, 95.5 * distance / focal, 0.0]])
    assert camera.project(corner)[0] == pytest.approx((0, 0), abs=1e-2)
    assert not camera.parallax
    tilted = truth.random_camera(np.random.default_rng(0), (192, 320), tilt_rad=0.5)
    assert tilted.project(np.zeros((1, 3), np.float32))[0] == pytest.approx((159.5, 95.5), abs=1e-2)
    assert np.linalg.det(tilted.T_camera_world[:3, :3]) == pytest.approx(1.0, abs=1e-5)
