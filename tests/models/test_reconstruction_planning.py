"""Where to look from next, and sections put together."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.cameras import Camera
from models.reconstruction import curves
from models.reconstruction.curves import Curve
from models.reconstruction.merging import MergeParams, NotMergeable, merge
from models.reconstruction.view_planning import NoView, PlanParams, depth_error, plan_views
from tests.models.known_cables import INTRINSICS, above, arc


def curve_through(points: np.ndarray, sigma: float = 1e-4) -> Curve:
    spline = curves.fit(points, 20, smooth=0.0)
    at = spline.at(curves.at_equal_lengths(spline, 60))
    tangents = spline.tangents(curves.at_equal_lengths(spline, 60))
    spread = sigma**2 * (np.eye(3) - tangents[:, :, None] * tangents[:, None])
    return Curve(spline, at, spread, np.full(60, 0.002), 1e-4)


def line(y: float = 0.08) -> Curve:
    return curve_through(np.stack([np.zeros(50), np.linspace(-y, y, 50), np.zeros(50)], axis=1))


def test_depth_error_of_the_textbook():
    assert depth_error(np.array([0.2]), 0.05, 600.0, 0.5) == pytest.approx(0.04 / 30 * 0.5)


def test_the_best_baseline_is_the_widest_that_keeps_a_straight_dlo_in_view():
    """A line x = 0 at depth z leaves the picture at b / 2 = (w / 2 - margin) z / f."""
    plan = plan_views(line(0.05), [above(0.0)], PlanParams(optimise="b"))
    assert plan.baseline_m == pytest.approx(2 * (639 / 2 - 20) * 0.25 / 600)
    assert plan.delta_z_m == 0
    assert plan.visible == 1


def test_nearer_is_better_down_to_the_limit():
    plan = plan_views(line(0.02), [above(0.0)], PlanParams(optimise="bz", nearest_m=0.15))
    assert plan.delta_z_m == pytest.approx(-0.1)
    near, far = (
        plan_views(line(0.02), [above(0.0)], PlanParams(optimise=o)) for o in ("bz", "fixed")
    )
    assert near.expected_sigma_m < far.expected_sigma_m


def test_all_planned_pictures_show_the_dlo():
    curve = curve_through(arc())
    plan = plan_views(curve, [above(0.02, 0.01)], PlanParams(least_visible=0.9))
    for pose in plan.poses:
        camera = Camera(INTRINSICS, pose)
        assert camera.sees(camera.project(curve.points_m), 19.0).mean() >= 0.9


def test_the_slide_is_across_the_dlo():
    turned = curve_through(arc()[:, [1, 0, 2]])
    plan = plan_views(turned, [above(0.0)], PlanParams())
    step = plan.poses[-1][:3, 3] - plan.poses[0][:3, 3]
    assert abs(step[1]) > 10 * abs(step[0])


def test_gain_is_what_the_new_pictures_bring():
    cameras = [above(-0.0125), above(0.0125)]
    again = plan_views(line(), cameras, PlanParams(views=2, optimise="fixed", baseline_m=0.025))
    assert again.gain == pytest.approx(0.0, abs=0.02)
    wider = plan_views(line(), cameras, PlanParams(views=2, optimise="fixed", baseline_m=0.05))
    assert wider.expected_sigma_m == pytest.approx(again.expected_sigma_m / 2, rel=0.05)


def test_moving_on_leaves_the_overlap():
    curve = line(0.09)
    plan = plan_views(curve, [above(0.0)], PlanParams(optimise="fixed"), advance=True)
    assert plan.poses[1][1, 3] == pytest.approx(0.09, abs=0.02)


@pytest.mark.parametrize(
    "params",
    [
        PlanParams(optimise="fixed", baseline_m=5.0, baseline_at_most_m=10.0),
        PlanParams(margin_px=400),
        PlanParams(nearest_m=3.0, delta_z_m=(-0.1, 0.1), optimise="fixed", baseline_m=9.0),
    ],
)
def test_no_pose_within_the_limits(params):
    with pytest.raises(NoView):
        plan_views(line(), [above(0.0)], params)


def test_a_dlo_behind_the_camera_cannot_be_looked_at():
    with pytest.raises(NoView, match="behind"):
        plan_views(line(), [above(0.0, z=-0.2)], PlanParams())


def test_sections_become_one_curve():
    truth = arc(0.4, count=4000)
    rng = np.random.default_rng(0)
    pieces = [truth[0:1800], truth[1000:3000][::-1], truth[2200:4000]]
    sections = [curve_through(p + rng.normal(0, 2e-4, (1, 3))) for p in pieces]
    merged = merge(sections, MergeParams())
    assert curves.distances(merged.curve.points_m, truth).max() < 1e-3
    assert merged.curve.length_m == pytest.approx(0.4, rel=0.03)
    assert curves.distances(truth[::10], merged.curve.points_m).max() < 1.5e-3


def test_the_order_of_a_scan_from_the_middle_is_taken_as_well():
    """The last piece of one direction lies inside the one before it, and runs the other way."""
    truth = arc(0.4, count=4000)
    sections = [
        curve_through(truth[0:1000][::-1]),
        curve_through(truth[0:1600][::-1]),
        curve_through(truth[1200:4000]),
    ]
    merged = merge(sections, MergeParams())
    assert merged.curve.length_m == pytest.approx(0.4, rel=0.03)


def test_two_sections_are_surer_than_one():
    both = merge([curve_through(arc()), curve_through(arc())], MergeParams()).curve.sigma_m
    one = merge([curve_through(arc())], MergeParams()).curve.sigma_m
    assert np.median(both) == pytest.approx(np.median(one) / np.sqrt(2), rel=0.1)


def test_an_outlier_is_passed_over():
    good = [curve_through(arc()) for _ in range(3)]
    bad = curve_through(arc())
    bad.points_m[30] += [0.0, 0.0, 0.01]
    merged = merge([*good, bad], MergeParams())
    assert merged.outliers >= 1
    assert curves.distances(merged.curve.points_m, arc()).max() < 5e-4


def test_sections_that_contradict_one_another_still_give_a_curve():
    """Where every point of a window was an outlier the weights were all zero, and the curve was
    NaN."""
    truth = arc(0.4, count=4000)
    bent = curve_through(
        truth[0:2000] + np.array([0, 0, 0.04]) * np.linspace(0, 1, 2000)[:, None] ** 8
    )
    merged = merge(
        [bent, curve_through(truth[1000:4000]), curve_through(truth[1900:4000])], MergeParams()
    )
    assert np.isfinite(merged.curve.points_m).all()
    assert merged.outliers > 0


def test_sections_of_another_dlo_are_named():
    with pytest.raises(NotMergeable) as caught:
        merge([curve_through(arc()), curve_through(arc() + np.array([1.0, 0, 0]))], MergeParams())
    assert caught.value.section == 1


def test_a_long_dlo_gets_as_many_points_as_an_answer_holds():
    """28 m at 5 mm were an internal error."""
    x = np.linspace(0, 30, 900)
    parts = [
        np.stack([x[k : k + 320], np.sin(x[k : k + 320]), 0 * x[k : k + 320]], axis=1)
        for k in (0, 290, 580)
    ]
    sections = [curve_through(part) for part in parts]
    merged = merge(sections, MergeParams(window_m=0.3))
    assert len(merged.curve.points_m) == 5000
    assert merged.curve.length_m == pytest.approx(
        curve_through(np.concatenate(parts)).length_m, rel=0.5
    )
    with pytest.raises(NotMergeable, match="at most 5000") as caught:
        merge(sections, MergeParams(spacing_m=0.005, coarser=False))
    assert caught.value.about == "spacing_m"


def test_windows_that_hold_too_much_are_refused_before_the_work():
    one = curve_through(arc())
    dense = Curve(
        one.spline,
        np.repeat(one.points_m, 50, axis=0),
        np.repeat(one.covariance_m2, 50, axis=0),
        np.repeat(one.radius_m, 50),
        one.radius_sigma_m,
    )
    many = [dense] * 6
    with pytest.raises(NotMergeable) as caught:
        merge(many, MergeParams(window_m=10.0, spacing_m=1e-5))
    assert caught.value.about == "window_m"
