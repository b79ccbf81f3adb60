"""Known curves come back: their place, their uncertainty, and which of several they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.polylines import arc_lengths
from models.reconstruction import curves
from models.reconstruction.matching import MatchParams, match
from models.reconstruction.reconstruct import (
    NotReconstructable,
    ReconstructParams,
    reconstruct_all,
    reconstruct_strand,
)
from models.reconstruction.tracking import continuing_strand, overlap
from models.reconstruction.triangulation import nearest_to_rays
from models.reconstruction.uncertainty import covers
from models.reconstruction.views import View
from tests.models.known_cables import about, above, arc, views_of

PARAMS = ReconstructParams()
ROW = [above(-0.025), above(0.0), above(0.025)]


def errors_mm(found, truth: np.ndarray) -> np.ndarray:
    return 1000 * curves.distances(found.curve.points_m, truth)


def unit_mm(sigma: float, baseline: float, z: float = 0.24, focal: float = 600.0) -> float:
    """Depth error of a single point, eq. 4.2."""
    return 1000 * z**2 * sigma / (focal * baseline)


def test_rays_through_a_point_meet_in_it():
    point = np.array([0.1, -0.2, 0.3])
    centers = np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0], [0.0, 0.5, 1.0]])
    directions = (point - centers)[:, None] * np.array([1.0, 2.0, 0.5])[:, None, None]
    assert nearest_to_rays(centers, directions)[0] == pytest.approx(point)


def test_parallel_rays_meet_nowhere():
    centers, directions = (
        np.array([[0.0, 0, 0], [1.0, 0, 0]]),
        np.array([[[0.0, 0, 1]], [[0.0, 0, 1]]]),
    )
    assert np.isnan(nearest_to_rays(centers, directions)).all()


def test_a_weight_of_zero_leaves_a_ray_out():
    centers = np.array([[0.0, 0, 0], [1.0, 0, 0], [5.0, 5, 5]])
    point = np.array([0.5, 0.5, 1.0])
    directions = np.stack(
        [(point - centers[0])[None], (point - centers[1])[None], np.array([[1.0, 0, 0]])]
    )
    weights = np.array([[1.0], [1.0], [0.0]])
    assert nearest_to_rays(centers, directions, weights)[0] == pytest.approx(point)


def test_exact_centerlines_are_matched_exactly():
    truth = arc()
    left, middle, right = views_of([truth], ROW)
    index = np.linspace(0, len(middle.strands[0].xy) - 1, 20).astype(int)
    matched = match(middle, middle.strands[0], index, [left, right], MatchParams())
    assert matched.found.all()
    points = middle.camera.center + matched.depth[:, None] * middle.camera.rays(
        middle.strands[0].xy[index]
    )
    assert (
        1000 * curves.distances(points, truth).max() < 0.4
    )  # the chords between points 5 px apart


def test_noise_of_half_a_pixel_costs_less_than_a_single_point_would():
    """The floor of the project: the mean error is below Z² σ / (f b)."""
    shares = []
    for seed in range(6):
        truth = arc(bend=2.0 + seed / 2)
        found = reconstruct_strand(views_of([truth], ROW, seed, 0.5), 1, 0, PARAMS)
        shares.append(errors_mm(found, truth).mean() / unit_mm(0.5, 0.05))
    assert np.mean(shares) < 1.0


@pytest.mark.parametrize(
    "cameras",
    [
        [
            above(-0.04, turn=about(1, -0.15)),
            above(0.0),
            above(0.04, turn=about(1, 0.15)),
        ],  # converging
        [above(-0.03, turn=about(2, 0.5)), above(0.0), above(0.03, turn=about(2, -0.3))],  # rolled
        [above(-0.03, z=0.22), above(0.0, z=0.25), above(0.03, z=0.3)],  # at other distances
        [above(-0.03, -0.02), above(0.03, 0.02)],  # two, aslant
    ],
    ids=["converging", "rolled", "distances", "two"],
)
def test_cameras_may_stand_anyhow(cameras):
    truth = arc(0.15)
    found = reconstruct_strand(views_of([truth], cameras, 1, 0.3), 0, 0, PARAMS)
    assert len(found.used) == len(cameras)
    assert errors_mm(found, truth).mean() < 1.0


def test_a_dlo_along_the_baseline_works_and_says_that_it_is_less_certain():
    across = arc(0.15, bend=4.0)
    turned = across[:, [1, 0, 2]]
    found = [reconstruct_strand(views_of([c], ROW, 3, 0.3), 1, 0, PARAMS) for c in (across, turned)]
    assert errors_mm(found[1], turned).mean() < 6
    assert found[1].curve.sigma_m.mean() > 1.5 * found[0].curve.sigma_m.mean()
    assert errors_mm(found[1], turned).mean() < 2 * 1000 * found[1].curve.sigma_m.mean()


def test_identical_crossing_dlos_are_told_apart():
    truths = [
        arc(0.16) @ about(2, angle).T + np.array([0, 0, 0.004 * k])
        for k, angle in enumerate((0.0, 0.9, 1.9))
    ]
    views = views_of(truths, ROW, 5, 0.3)
    views[0] = replace(views[0], strands=views[0].strands[::-1])
    found = reconstruct_all(views, PARAMS)
    assert len(found) == 3
    for one in found:
        first, middle, last = (one.supports[k].strands[0] for k in range(3))
        assert (2 - first, last) == (middle, middle)


def test_a_self_crossing_is_followed_through():
    t = np.linspace(-2.2, 2.2, 3000)
    truth = np.stack(
        [0.05 * np.sin(t * 1.4), 0.05 * np.sin(t * 0.9) + 0.01 * t, 0.01 + 0.004 * np.sin(t)],
        axis=1,
    )
    found = reconstruct_strand(
        views_of([truth], [above(0, -0.03), above(0), above(0, 0.03)], 2, 0.2), 1, 0, PARAMS
    )
    assert errors_mm(found, truth).mean() < 1.0
    assert found.curve.length_m == pytest.approx(arc_lengths(truth)[-1], rel=0.05)


def test_a_view_without_the_dlo_is_dropped():
    views = views_of([arc()], [*ROW, above(0.05)], 0, 0.2)
    views[3] = View(views[3].camera, (), "empty")
    found = reconstruct_strand(views, 1, 0, PARAMS)
    assert [s.verdict for s in found.supports] == ["used", "used", "used", "not_found"]
    assert errors_mm(found, arc()).mean() < 0.5


def test_a_pose_wrong_by_five_centimeters_is_found_among_four():
    truth = arc()
    views = views_of([truth], [above(-0.03), above(-0.01), above(0.01), above(0.03)], 0, 0.3)
    views[3] = View(above(0.08), views[3].strands, "wrong")
    found = reconstruct_strand(views, 0, 0, PARAMS)
    assert [s.verdict for s in found.supports] == ["used", "used", "used", "does_not_fit"]
    assert errors_mm(found, truth).mean() < 1.0


def test_among_three_a_wrong_pose_is_noticed():
    views = views_of([arc()], ROW, 0, 0.3)
    views[2] = View(above(0.075), views[2].strands, "wrong")
    found = reconstruct_strand(views, 1, 0, PARAMS)
    assert sorted(s.verdict for s in found.supports) == ["does_not_fit", "used", "used"]


def test_a_dlo_in_one_view_only_is_no_curve():
    views = views_of([arc()], ROW)
    alone = [views[0], View(views[1].camera, (), "a"), View(views[2].camera, (), "b")]
    with pytest.raises(NotReconstructable, match="view 0"):
        reconstruct_strand(alone, 0, 0, PARAMS)


def test_what_lies_behind_the_cameras_is_no_curve():
    up = np.diag([1.0, -1.0, -1.0])
    views = views_of([arc()], ROW)
    behind = [
        View(
            replace(v.camera, T_world_camera=_turned(v.camera.T_world_camera, up)),
            v.strands,
            v.name,
        )
        for v in views
    ]
    swapped = [behind[2], behind[1], behind[0]]
    crossed = [replace(v, camera=c.camera) for v, c in zip(behind, swapped, strict=True)]
    with pytest.raises(NotReconstructable):
        reconstruct_strand(crossed, 1, 0, PARAMS)


def _turned(pose: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    out = pose.copy()
    out[:3, :3] = rotation @ pose[:3, :3]
    return out


@pytest.mark.slow
def test_the_stated_uncertainty_covers_the_truth():
    """90 % ellipsoids across the curve, over DLOs whose errors are independent from point to point
    and from view to view: so nothing is said to be shared, and nothing to stray."""
    independent = ReconstructParams(shared_px=0.0, stray=0.0)
    inside = []
    for seed in range(12):
        truth = arc(bend=2 + seed / 4)
        found = reconstruct_strand(views_of([truth], ROW, seed, 0.5), 1, 0, independent)
        inside.append(covered(found.curve, truth))
    assert 0.8 < np.mean(inside) < 0.98


def covered(curve, truth: np.ndarray) -> float:
    return float(np.mean(covers(curve, truth, 0.9)))


def test_equal_views_give_equal_curves():
    views = views_of([arc()], ROW, 0, 0.3)
    first, again = (reconstruct_strand(views, 1, 0, PARAMS).curve.points_m for _ in range(2))
    assert np.array_equal(first, again)


def test_the_radius_is_that_of_the_dlo():
    found = reconstruct_strand(views_of([arc(rise=0.0)], ROW), 1, 0, PARAMS)
    assert found.curve.mean_radius_m == pytest.approx(0.0025, rel=0.02)


def test_the_section_before_says_which_dlo_to_go_on_with():
    truths = [arc(0.3), arc(0.3) + np.array([0.04, 0.0, 0.0])]
    before = reconstruct_strand(views_of(truths, ROW, 0, 0.2), 1, 1, PARAMS).curve
    ahead = views_of(truths[::-1], [above(x, 0.06) for x in (-0.025, 0.0, 0.025)], 1, 0.2)
    view, strand = continuing_strand(before, ahead)
    assert strand == 0
    following = reconstruct_strand(ahead, view, strand, PARAMS, before)
    assert errors_mm(following, truths[1]).mean() < 0.5
    assert 0.3 < overlap(following.curve, before) < 0.9
