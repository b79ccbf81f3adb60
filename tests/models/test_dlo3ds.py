"""The published method, inside its assumptions and outside."""

from __future__ import annotations

import numpy as np
import pytest

from models.reconstruction import curves
from models.reconstruction.published.dlo3ds import Dlo3dsParams, match_rows, reconstruct, select
from models.reconstruction.reconstruct import NotReconstructable
from tests.models.known_cables import about, above, arc, views_of

ROW = [above(-0.025), above(0.0), above(0.025)]


def test_samples_are_matched_along_image_rows():
    slanted = np.array([[100.0, 0.0], [150.0, 100.0]])
    shifted = slanted + np.array([40.0, 0.0])
    first, second = match_rows([slanted, shifted], 11)
    assert first[:, 1] == pytest.approx(second[:, 1])
    assert second[:, 0] - first[:, 0] == pytest.approx(np.full(11, 40.0))


def test_of_several_crossings_the_one_that_continues_is_taken():
    """An S of which a row is crossed three times."""
    y = np.concatenate([np.linspace(0, 60, 61), np.linspace(59, 30, 30), np.linspace(31, 100, 70)])
    s = np.stack([np.linspace(0, 160, len(y)), y], axis=1)
    first, second = match_rows([s, s + np.array([25.0, 0.0])], 40)
    assert np.nanmax(np.abs(second[:, 0] - first[:, 0] - 25)) < 1.5


def test_a_known_curve_comes_back():
    truth = arc()
    found = reconstruct(views_of([truth], ROW), 1, 0, Dlo3dsParams())
    assert 1000 * curves.distances(found.curve.points_m, truth).mean() < 0.5
    assert found.reprojection_px < 0.7


def test_the_target_is_followed_by_its_slope():
    truths = [arc() + np.array([-0.04, 0, 0]), (arc() @ about(2, 0.5).T) + np.array([0.04, 0, 0])]
    views = views_of(truths, ROW)
    assert select(views, 0, 1) == [1, 1, 1]
    assert select(views, 0, 0) == [0, 0, 0]


@pytest.mark.parametrize(
    "camera", [above(0.025, turn=about(1, 0.1)), above(0.0, 0.03)], ids=["turned", "aside"]
)
def test_other_rigs_are_refused_by_name(camera):
    views = views_of([arc()], [ROW[0], ROW[1], camera])
    with pytest.raises(NotReconstructable, match="view 2 does not"):
        reconstruct(views, 1, 0, Dlo3dsParams())


def test_a_dlo_along_the_rows_cannot_be_matched():
    flat = np.stack([np.linspace(-0.08, 0.08, 500), np.zeros(500), np.zeros(500)], axis=1)
    with pytest.raises(NotReconstructable, match="rows"):
        reconstruct(views_of([flat], ROW), 1, 0, Dlo3dsParams())
