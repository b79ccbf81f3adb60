"""Strands that were joined wrongly in the pictures, put right by all views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.reconstruction.joining import JoinParams, join_costs, partners, rejoin
from models.reconstruction.matching import without_leaps
from models.reconstruction.piece_ends import PieceEnds
from models.reconstruction.reconstruct import (
    NotReconstructable,
    ReconstructParams,
    reconstruct_strand,
)
from models.reconstruction.views import Strand, View
from tests.models.known_cables import about, above, arc, views_of

PARAMS = JoinParams()
ROW = [above(-0.03), above(0.0), above(0.03)]


def crossing_at(angle: float, apart_m: float = 0.006) -> list[np.ndarray]:
    """Two equal DLOs that cross in the middle of the picture, one ``apart_m`` over the other."""
    lower, upper = (
        arc(0.16, bend=1.0, rise=0.008) @ about(2, turn).T for turn in (-angle / 2, angle / 2)
    )
    return [lower, upper + np.array([0.0, 0.0, apart_m])]


def doubtful(view: View, reach_px: float) -> View:
    """The view with strands that are not known within ``reach_px`` of where they cross."""
    apart = np.linalg.norm(view.strands[0].xy[:, None] - view.strands[1].xy[None], axis=2)
    middle = view.strands[0].xy[np.unravel_index(np.argmin(apart), apart.shape)[0]]
    unknown = [np.hypot(*(s.xy - middle).T) < reach_px for s in view.strands]
    return replace(
        view,
        strands=tuple(replace(s, known=~u) for s, u in zip(view.strands, unknown, strict=True)),
    )


def swapped(view: View) -> View:
    """The view with both strands cut in the middle of the doubtful stretch, each going on as the
    other."""
    a, b = view.strands
    i, j = (int(np.median(np.flatnonzero(~s.known))) for s in (a, b))
    return replace(view, strands=(_spliced(a, i, b, j), _spliced(b, j, a, i)))


def _spliced(first: Strand, i: int, second: Strand, j: int) -> Strand:
    parts = [(getattr(first, n)[:i], getattr(second, n)[j:]) for n in ("xy", "width_px", "known")]
    return Strand.through(*(np.concatenate(part) for part in parts))


def strays_px(strand: Strand, truth: np.ndarray, view: View) -> float:
    """How far the known points of a strand come off a true curve."""
    true = view.camera.project(truth)
    known = strand.xy[strand.known]
    return float(np.min(np.linalg.norm(known[:, None] - true[None], axis=2), axis=1).max())


@pytest.mark.parametrize("angle", [0.5, 1.2])
def test_strands_that_all_views_joined_wrongly_are_put_right(angle):
    truths = crossing_at(angle)
    wrong = [swapped(doubtful(v, 18.0)) for v in views_of(truths, ROW, 1, 0.2)]
    assert min(strays_px(s, t, wrong[1]) for s in wrong[1].strands for t in truths) > 20
    for joined in rejoin(wrong):
        assert len(joined.view.strands) == 2
        best = [min(strays_px(s, t, joined.view) for t in truths) for s in joined.view.strands]
        assert max(best) < 2
        assert joined.share_px.min() > 50, "each new strand is half of both old ones"


def test_right_joins_stay():
    views = [doubtful(v, 18.0) for v in views_of(crossing_at(0.7), ROW, 2, 0.2)]
    for before, after in zip(views, rejoin(views), strict=True):
        assert len(after.view.strands) == 2
        assert np.argmax(after.share_px, axis=1).tolist() == [0, 1]
        assert after.view.strands[0].length_px == pytest.approx(
            before.strands[0].length_px, rel=0.02
        )


def test_views_without_doubt_stay_as_they_are():
    views = views_of(crossing_at(0.7), ROW)
    assert all(a.view is v for a, v in zip(rejoin(views), views, strict=True))


def test_a_view_without_strands_stays_empty():
    views = [doubtful(v, 18.0) for v in views_of(crossing_at(0.7), ROW)]
    views[2] = replace(views[2], strands=())
    joined = rejoin(views)
    assert joined[2].view.strands == ()
    assert [len(j.view.strands) for j in joined[:2]] == [2, 2]


def test_a_strand_of_which_nothing_is_known_is_no_curve():
    views = views_of([arc()], ROW)
    views[1] = replace(
        views[1],
        strands=(replace(views[1].strands[0], known=np.zeros_like(views[1].strands[0].known)),),
    )
    assert len(rejoin(views)[1].view.strands) == 1
    with pytest.raises(NotReconstructable):
        reconstruct_strand(views, 1, 0, ReconstructParams())


def test_a_dlo_is_reconstructed_through_wrong_joins():
    """Five crossing cables of one color were followed in 91 of 100 cases: the joins of the pictures
    were believed."""
    truths = crossing_at(0.6)
    views = [
        j.view for j in rejoin([swapped(doubtful(v, 18.0)) for v in views_of(truths, ROW, 1, 0.2)])
    ]
    found = reconstruct_strand(views, 1, 0, ReconstructParams())
    true = [views[1].camera.project(t) for t in truths]
    seen = views[1].camera.project(found.curve.points_m)
    off = [np.min(np.linalg.norm(seen[:, None] - t[None], axis=2), axis=1).max() for t in true]
    assert min(off) < 2


def ends(*rows: tuple[float, float, float, float, float]) -> PieceEnds:
    """Each x, y, direction in degrees, disparity, its standard deviation."""
    x, y, degrees, disparity, sigma = (np.array(c) for c in zip(*rows, strict=True))
    turn = np.radians(degrees)
    outward = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return PieceEnds(
        np.stack([x, y], axis=1), outward, disparity, np.zeros(len(x)), sigma, np.zeros(len(x))
    )


FREE = (0.0, 900.0, 90.0, 0.0, np.inf)
"""The other end of a piece, out of reach."""


def test_what_goes_straight_on_at_the_same_depth_costs_least():
    facing = ends(
        FREE,
        (0.0, 0.0, 0.0, 60.0, 0.5),
        (30.0, 0.0, 180.0, 60.0, 0.5),
        FREE,
        (30.0, 0.0, 150.0, 60.0, 0.5),
        FREE,
        (30.0, 0.0, 180.0, 63.0, 0.5),
        FREE,
        (30.0, 0.0, 0.0, 60.0, 0.5),
        FREE,
    )
    straight, bent, deeper, away = join_costs(facing, np.arange(5), 8.0, PARAMS)[1, [2, 4, 6, 8]]
    assert straight == pytest.approx(30 / (PARAMS.far_widths * 8.0))
    assert bent == pytest.approx(
        straight + np.radians(30) ** 2 / (PARAMS.turn**2 + (30 * PARAMS.bend) ** 2)
    )
    assert deeper == pytest.approx(straight + PARAMS.depth_at_most)
    assert away == np.inf


def test_a_depth_that_nobody_knows_costs_nothing():
    unknown = ends(FREE, (0.0, 0.0, 0.0, 0.0, np.inf), (30.0, 0.0, 180.0, 60.0, 0.5), FREE)
    cost = join_costs(unknown, np.arange(2), 8.0, PARAMS)
    assert cost[1, 2] == pytest.approx(30 / (PARAMS.far_widths * 8.0))


def test_an_arc_bends_less_than_an_s():
    shapes = ends(
        FREE,
        (0.0, 0.0, 20.0, 0.0, np.inf),
        (30.0, 0.0, 160.0, 0.0, np.inf),
        FREE,
        (30.0, 0.0, 200.0, 0.0, np.inf),
        FREE,
    )
    arc_like, s_like = join_costs(shapes, np.arange(3), 8.0, PARAMS)[1, [2, 4]]
    straight = 30 / (PARAMS.far_widths * 8.0)
    assert s_like - straight == pytest.approx(3 * (arc_like - straight))


def table(*links: tuple[int, int, float], count: int = 4) -> np.ndarray:
    cost = np.full((count, count), np.inf)
    for a, b, value in links:
        cost[a, b] = cost[b, a] = value
    return cost


def test_the_cheapest_joins_of_all_ends_together_are_made():
    """The single cheapest one, 0 to 1, would leave 2 and 3 alone."""
    cost = table((0, 1, 0.1), (0, 2, 0.5), (1, 3, 0.5))
    assert partners(cost, PARAMS).tolist() == [2, 3, 0, 1]


def test_an_open_question_is_left_open():
    cost = table((0, 1, 0.4), (2, 3, 0.4), (0, 2, 0.5), (1, 3, 0.5))
    assert partners(cost, PARAMS).tolist() == [0, 1, 2, 3]
    assert partners(table((0, 1, PARAMS.dearest + 0.1)), PARAMS).tolist() == [0, 1, 2, 3]


def test_of_three_ends_one_stays_alone():
    cost = table((0, 1, 0.1), (1, 2, 0.2), (0, 2, 2.9), count=3)
    assert partners(cost, replace(PARAMS, margin=0.0)).tolist() == [1, 0, 2]


def test_past_a_leap_of_the_depth_nothing_is_believed():
    """Where a DLO was found in no other view, its rays met other DLOs at a quarter of the
    distance."""
    depth = np.array([0.30, 0.31, np.nan, 0.30, 0.29, 0.07, 0.07])
    kept = without_leaps(depth, np.full(6, 0.01), steepest=6.0)
    assert kept[:5] == pytest.approx(depth[:5], nan_ok=True)
    assert np.isnan(kept[5:]).all()
