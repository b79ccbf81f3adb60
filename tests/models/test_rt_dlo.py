"""RT-DLO on hand-drawn masks whose answer is known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from models.geometry.polylines import arc_lengths
from models.instances.published.rt_dlo import RtDloParams, extract
from models.instances.published.rt_dlo.orientation import CLASSES
from tests.models.drawn_masks import assert_valid, circle, colored, drawn, loop

RED, BLUE = (200, 30, 30), (30, 40, 190)
DOWN = np.array([[60.0, 40.0], [260.0, 200.0]])
UP = np.array([[60.0, 200.0], [260.0, 40.0]])


def deviation(centerline: np.ndarray, truth: np.ndarray) -> float:
    """Largest distance of a centerline point, the round caps left out, to a densely drawn true
    line."""
    steps = np.linspace(0, 1, 500)[:, None]
    dense = np.concatenate([a + steps * (b - a) for a, b in pairwise(truth)])
    return float(
        np.hypot(*(centerline[1:-1, None] - dense[None]).transpose(2, 0, 1)).min(axis=1).max()
    )


def test_straight_bar():
    line = np.array([[40.0, 120.0], [280.0, 120.0]])
    mask = drawn(line)
    scene = extract(mask)
    (bar,) = scene.instances
    assert scene.crossings == ()
    assert not bar.closed
    assert deviation(bar.centerline_xy, line) < 1.5
    assert bar.width_px == pytest.approx(10, abs=1.5)
    assert bar.length_px == pytest.approx(250, abs=8)  # the round caps belong to it
    assert [e.kind for e in bar.endpoints] == ["free", "free"]
    assert sorted(e.xy[0] for e in bar.endpoints) == pytest.approx([35, 285], abs=4)
    np.testing.assert_array_equal(scene.labels, mask.astype(np.uint8))


def test_centerline_points_are_evenly_spaced():
    (strand,) = extract(drawn(circle((160, 120), 80, 0.3, 5.0))).instances
    steps = np.diff(arc_lengths(strand.centerline_xy))
    assert np.ptp(steps) < 0.05 * steps.mean()
    assert steps.mean() == pytest.approx(5, abs=0.5)


def test_crossing_strands_are_two_instances_with_one_crossing():
    scene = extract(drawn(DOWN, UP))
    assert len(scene.instances) == 2
    on_down = [deviation(i.centerline_xy, DOWN) < 2.5 for i in scene.instances]
    on_up = [deviation(i.centerline_xy, UP) < 2.5 for i in scene.instances]
    assert sorted(zip(on_down, on_up, strict=True)) == [(False, True), (True, False)]
    (crossing,) = scene.crossings
    assert crossing.xy == pytest.approx((160, 120), abs=3)
    assert {crossing.over.instance, crossing.under.instance} == {1, 2}
    assert crossing.over.u == pytest.approx(0.5, abs=0.03)
    assert crossing.score == 0.5


@pytest.mark.parametrize("red_on_top", [True, False])
def test_order_follows_the_color_and_the_upper_strand_owns_the_pixels(red_on_top):
    strands = [(DOWN, BLUE), (UP, RED)] if red_on_top else [(UP, RED), (DOWN, BLUE)]
    scene = extract(drawn(DOWN, UP), colored(*strands))
    (crossing,) = scene.crossings
    upper = scene.instances[crossing.over.instance - 1]
    assert deviation(upper.centerline_xy, UP if red_on_top else DOWN) < 2.5
    assert crossing.score > 0.9
    assert scene.labels[120, 160] == crossing.over.instance


def test_colors_decide_where_strands_touch_and_part():
    """The same outline is two strands that cross or two that touch; the picture tells which."""
    left = np.array([[40.0, 60.0], [140.0, 118.0], [180.0, 118.0], [280.0, 60.0]])
    right = left * np.array([1, -1]) + np.array([0, 240])
    scene = extract(drawn(left, right), colored((left, RED), (right, BLUE)))
    assert len(scene.instances) == 2
    assert all(np.ptp(i.centerline_xy[[0, -1], 1]) < 15 for i in scene.instances)
    assert scene.crossings == ()


def test_self_crossing_loop_is_one_instance():
    scene = extract(drawn(loop()))
    (strand,) = scene.instances
    (crossing,) = scene.crossings
    assert (crossing.over.instance, crossing.under.instance) == (1, 1)
    assert abs(crossing.over.u - crossing.under.u) > 0.4
    assert strand.length_px == pytest.approx(arc_lengths(loop())[-1], rel=0.06)
    assert not strand.closed


def test_ring_is_closed_and_has_no_ends():
    scene = extract(drawn(circle((160, 120), 70)))
    (ring,) = scene.instances
    assert ring.closed
    assert ring.endpoints == ()
    assert scene.crossings == ()
    np.testing.assert_allclose(ring.centerline_xy[0], ring.centerline_xy[-1], atol=0.5)
    assert ring.length_px == pytest.approx(2 * np.pi * 70, rel=0.03)


def test_parallel_strands_stay_apart():
    upper = np.array([[20.0, 100.0], [300.0, 100.0]])
    scene = extract(drawn(upper, upper + np.array([0, 14])))
    assert len(scene.instances) == 2
    assert scene.crossings == ()
    assert sorted(i.centerline_xy[:, 1].mean() for i in scene.instances) == pytest.approx(
        [100, 114], abs=1.5
    )
    assert {scene.labels[100, 160], scene.labels[114, 160]} == {1, 2}


def test_strand_that_ends_at_another_is_hidden_there_and_leaves_at_the_border():
    across = np.array([[20.0, 120.0], [300.0, 120.0]])
    down = np.array([[160.0, 120.0], [160.0, 239.0]])
    scene = extract(drawn(across, down))
    assert len(scene.instances) == 2
    assert [e.kind for e in scene.instances[0].endpoints] == ["free", "free"]
    assert sorted(e.kind for e in scene.instances[1].endpoints) == ["border", "hidden"]
    border = next(e for e in scene.instances[1].endpoints if e.kind == "border")
    assert border.xy == pytest.approx((160, 239), abs=2)


def test_gap_in_the_mask_is_bridged_and_labelled():
    mask = drawn(np.array([[20.0, 120.0], [300.0, 120.0]]))
    mask[:, 150:170] = False
    scene = extract(mask)
    assert len(scene.instances) == 1
    assert scene.labels[120, 160] == 1


def test_shallow_crossing_with_a_long_shared_stretch():
    """Algorithm 4 alone pairs strands at each of the two forks, and may join a strand to the wrong
    one."""
    one = np.array([[20.0, 100.0], [300.0, 140.0]])
    other = one * np.array([1, -1]) + np.array([0, 240])
    scene = extract(drawn(one, other))
    assert len(scene.instances) == 2
    assert all(abs(np.diff(i.centerline_xy[[0, -1], 1])[0]) > 30 for i in scene.instances)
    assert len(scene.crossings) == 1


def test_small_specks_are_no_instances():
    mask = drawn(np.array([[40.0, 120.0], [280.0, 120.0]]))
    mask[20:26, 20:30] = True
    mask[200:203, 100:102] = True
    assert len(extract(mask).instances) == 1


def test_the_network_is_asked_for_every_vertex_and_its_angles_are_used():
    """A network that calls everything vertical leaves no edge along a horizontal bar."""
    asked = []

    def vertical(patches):
        asked.append(patches.shape)
        scores = np.zeros((len(patches), CLASSES), np.float32)
        scores[:, 90] = 1
        return scores

    mask = drawn(np.array([[40.0, 120.0], [280.0, 120.0]]))
    assert extract(mask, None, RtDloParams(), [vertical]).instances == ()
    assert len(asked) == 1
    assert asked[0][1:] == (15, 15)


def test_same_input_gives_the_same_bytes():
    mask, image = drawn(DOWN, UP, loop()), colored((DOWN, BLUE), (UP, RED))
    first, second = extract(mask, image), extract(mask, image)
    assert first.labels.tobytes() == second.labels.tobytes()
    assert [i.centerline_xy.tobytes() for i in first.instances] == [
        i.centerline_xy.tobytes() for i in second.instances
    ]
    assert [vars(c) | {"over": vars(c.over), "under": vars(c.under)} for c in first.crossings] == [
        vars(c) | {"over": vars(c.over), "under": vars(c.under)} for c in second.crossings
    ]


def test_picture_of_another_size_is_refused():
    with pytest.raises(ValueError, match="does not belong"):
        extract(np.zeros((10, 10), bool), np.zeros((10, 11, 3), np.uint8))


def _noise(shape, share):
    return np.random.default_rng(5).random(shape) < share


def _dot(shape):
    mask = np.zeros(shape, bool)
    mask[shape[0] // 2, shape[1] // 2] = True
    return mask


UGLY = {
    "nothing": np.zeros((90, 120), bool),
    "everything": np.ones((90, 120), bool),
    "all but a pixel": ~_dot((90, 120)),
    "one pixel": _dot((90, 120)),
    "one by one": np.ones((1, 1), bool),
    "no pixels": np.zeros((0, 7), bool),
    "one row": np.ones((1, 200), bool),
    "half noise": _noise((200, 300), 0.5),
    "sparse noise": _noise((200, 300), 0.1),
    "dense noise": _noise((200, 300), 0.9),
    "noisy ribbon": _noise((20, 8000), 0.5),
    "checkers": np.indices((100, 100)).sum(0) % 2 == 0,
    "thin stripes": np.repeat(np.arange(200)[:, None] % 3 == 0, 300, axis=1),
}


@pytest.mark.parametrize("with_image", [True, False])
@pytest.mark.parametrize("name", UGLY)
def test_ugly_masks_give_a_valid_scene(name, with_image):
    mask = UGLY[name]
    scene = extract(mask, np.zeros((*mask.shape, 3), np.uint8) if with_image else None)
    assert_valid(scene, mask)


@pytest.mark.parametrize(
    "params", [RtDloParams(1e-9), RtDloParams(1.0, 64, 0.0), RtDloParams(0.15, 2, 0.99)]
)
def test_extreme_parameters_do_no_harm(params):
    extract(drawn(DOWN, UP), None, params)


def test_long_strip_keeps_its_length():
    (strand,) = extract(
        drawn(np.array([[0.0, 10.0], [7999.0, 10.0]]), width=7, shape=(20, 8000))
    ).instances
    assert strand.length_px == pytest.approx(7999, abs=10)
    assert [e.kind for e in strand.endpoints] == ["border", "border"]


def test_huge_picture_is_worked_on_smaller_and_answered_in_its_own_pixels():
    line = np.array([[400.0, 1500.0], [3600.0, 1500.0]])
    mask = drawn(line, width=60, shape=(3000, 4000))
    scene = extract(mask)
    (bar,) = scene.instances
    assert np.abs(bar.centerline_xy[:, 1] - 1500).max() < 3
    assert bar.width_px == pytest.approx(60, abs=6)
    assert bar.length_px == pytest.approx(3260, abs=40)
    assert scene.labels.shape == mask.shape
    assert np.count_nonzero(scene.labels) > 0.98 * np.count_nonzero(mask)
