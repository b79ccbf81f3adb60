"""Lenses: there and back for every model, nothing beyond where they fold, and places with known
answers."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from models.geometry import lenses
from models.geometry.cameras import Camera, CameraError, Intrinsics

LENSES = [
    ("plumb_bob", (-0.28, 0.07, 0.0005, -0.0003)),
    ("plumb_bob", (-0.28, 0.07, 0.0005, -0.0003, 0.01)),
    ("rational_polynomial", (-0.28, 0.09, 0.0005, -0.0003, 0.01, 0.001, 0.0, 0.0)),
    ("rational_polynomial", (12.0, 30.0, 1e-4, -2e-4, 1.5, 12.2, 33.0, 6.0)),
    (
        "rational_polynomial",
        (-0.2, 0.05, 5e-4, -3e-4, 0.01, 1e-3, 0.0, 0.0, 0.002, -0.001, 0.001, 0.0005),
    ),
    (
        "rational_polynomial",
        (-0.2, 0.05, 5e-4, 0.0, 0.01, 1e-3, 0.0, 0.0, 0.002, 0.0, 0.001, 0.0, 0.02, -0.01),
    ),
    ("equidistant", (-0.02, 0.005, -0.001, 0.0)),
    ("equidistant", ()),
]


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
def test_every_model_leads_there_and_back(model, coefficients):
    straight = np.stack(
        np.meshgrid(np.linspace(-0.7, 0.7, 9), np.linspace(-0.5, 0.5, 9)), axis=-1
    ).reshape(-1, 2)
    bent = lenses.bend(straight, model, coefficients)
    assert np.abs(bent - straight).max() > 0.01
    assert lenses.straighten(bent, model, coefficients) == pytest.approx(straight, abs=1e-8)


def test_an_equidistant_lens_without_coefficients_is_no_pinhole():
    """It was taken for one: radius in the picture is the angle, not its tangent."""
    bent = lenses.bend(np.array([[1.0, 0.0]]), "equidistant", ())
    assert bent[0] == pytest.approx([np.pi / 4, 0.0])


def test_the_polynomial_is_opencvs():
    coefficients = LENSES[2][1]
    bent = np.array([[0.3, -0.2], [0.0, 0.0], [-0.4, 0.35]])
    enough = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    theirs = cv2.undistortPoints(
        bent[:, None], np.eye(3), np.array(coefficients), None, None, None, enough
    )
    assert lenses.straighten(bent, "rational_polynomial", coefficients) == pytest.approx(
        theirs[:, 0], abs=1e-6
    )


@pytest.mark.parametrize("coefficients", [c for model, c in LENSES if model != "equidistant"])
def test_every_coefficient_of_the_polynomial_is_opencvs(coefficients):
    straight = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    rays, still = np.concatenate([straight, np.ones((50, 1))], axis=1), np.zeros(3)
    theirs, _ = cv2.projectPoints(rays, still, still, np.eye(3), np.array(coefficients))
    ours = lenses.bend(straight, "rational_polynomial", coefficients)
    assert ours == pytest.approx(theirs[:, 0], abs=1e-12)


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
def test_many_places_are_straightened_as_each_alone(model, coefficients):
    bent = np.random.default_rng(0).uniform(-0.4, 0.4, (10_000, 2))
    straight = lenses.straighten(bent, model, coefficients)
    assert straight.shape == bent.shape
    some = slice(None, None, 999)
    assert straight[some] == pytest.approx(
        lenses.straighten(bent[some], model, coefficients), abs=1e-9
    )


def test_nothing_is_seen_beyond_where_a_lens_folds():
    """r - r^3 / 3 rises up to r = 1, where it is 2 / 3; farther out it would come back in."""
    coefficients = (-1 / 3, 0.0, 0.0, 0.0)
    assert lenses.field("plumb_bob", coefficients) == pytest.approx(1.0, rel=1e-2)
    assert np.isnan(lenses.bend(np.array([[1.2, 0.0]]), "plumb_bob", coefficients)).all()
    assert np.isnan(lenses.straighten(np.array([[0.7, 0.0]]), "plumb_bob", coefficients)).all()
    assert np.isfinite(lenses.straighten(np.array([[0.6, 0.0]]), "plumb_bob", coefficients)).all()


def test_a_wide_fisheye_sees_what_lies_far_aside():
    """The picture's own rectangle, as of a pinhole, ended at 47 degrees where the lens shows 61."""
    fisheye = Camera(Intrinsics(640, 480, 300.0, 300.0, 319.5, 239.5, (), "equidistant"), np.eye(4))
    at = np.array([[np.tan(angle), 0.0, 1.0] for angle in np.radians([0.0, 55.0, 60.0, 62.0])])
    assert fisheye.sees(fisheye.project(at)).tolist() == [True, True, True, False]


def test_a_lens_that_folds_in_the_middle_of_the_picture_is_refused():
    with pytest.raises(CameraError, match="folds"):
        Intrinsics(640, 480, 600.0, 600.0, 320.0, 240.0, (-1000.0, 0.0, 0.0, 0.0))
