"""Answers as arrays of a fixed shape."""

from __future__ import annotations

import numpy as np
import pytest
from dlo_client import InvalidArgument, NoopResult, state
from dlo_client.contracts import MergeCurvesResult

from tests.clients import curve_samples, samples


def test_instances_are_padded_best_first():
    scene = samples.two_cables()
    found = state(scene, nodes=5, cables=3)
    assert found.points.shape == (3, 5, 2)
    best = max(scene.instances, key=lambda one: one.score)
    assert found.ids.tolist() == [best.id, 3 - best.id, 0]
    assert found.there.tolist() == [True, True, False]
    assert (found.points[2] == 0).all()
    steps = np.linalg.norm(np.diff(found.points[0], axis=0), axis=1)
    assert steps == pytest.approx([steps[0]] * 4)
    assert tuple(found.points[0, 0]) == best.centerline_xy[0]
    assert np.isnan(found.covariance).all(), "pixels have no stated covariance"
    assert state(scene, nodes=5, cables=1).ids.tolist() == [best.id]
    assert repr(found) == "PolicyState(2 of 3 cables, points (3, 5, 2))"


def test_curves_have_covariances_of_their_nodes():
    curve = curve_samples.straight(count=21)
    found = state(curve, nodes=41)
    assert found.points.shape == (1, 41, 3)
    given = curve.covariance_m2[10]
    expected = [
        [given[0], given[1], given[2]],
        [given[1], given[3], given[4]],
        [given[2], given[4], given[5]],
    ]
    assert found.covariance[0, 20] == pytest.approx(np.array(expected))
    merged = MergeCurvesResult(curve=curve, disagreement_m=0, outliers=0)
    assert (state(merged, nodes=41).points == found.points).all()
    assert state(curve_samples.result(), nodes=4).points.shape[1:] == (4, 3)


def test_an_empty_scene_has_the_shape_too():
    empty = samples.two_cables().model_copy(update={"instances": [], "crossings": []})
    assert state(empty, nodes=4, cables=2).points.shape == (2, 4, 2)
    assert state(empty, nodes=4).points.shape == (0, 4, 2)


@pytest.mark.parametrize(
    ("result", "nodes"), [(NoopResult(held_s=0), 4), (samples.two_cables(), 1)]
)
def test_what_has_no_cables_is_refused(result, nodes):
    with pytest.raises(InvalidArgument):
        state(result, nodes=nodes)
