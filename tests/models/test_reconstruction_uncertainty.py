"""Depth that cannot be seen is said to be unknown, with what to move; depth that can be seen is
not."""

from __future__ import annotations

import numpy as np
import pytest

from models.reconstruction import curves
from models.reconstruction.published import dlo3ds
from models.reconstruction.reconstruct import (
    NotReconstructable,
    Reconstruction,
    ReconstructParams,
    reconstruct_strand,
)
from models.reconstruction.uncertainty import depth_warning
from tests.models.known_cables import about, above, arc, views_of


def along_x(bend_m: float = 0.0) -> np.ndarray:
    """(n, 3) 20 cm along the way of the camera, swinging ``bend_m`` across it."""
    x = np.linspace(-0.1, 0.1, 2000)
    return np.stack([x, bend_m * np.sin(np.pi * x / 0.05), np.full(len(x), 0.01)], axis=1)


def found(
    truth: np.ndarray, places: tuple[float, ...], seed: int, noise: float = 0.15
) -> tuple[Reconstruction, str | None]:
    cameras = [above(x) for x in places]
    made = reconstruct_strand(
        views_of([truth], cameras, seed, noise), len(places) // 2, 0, ReconstructParams()
    )
    return made, depth_warning(made.curve, [cameras[k] for k in made.used])


def believed(made: Reconstruction, truth: np.ndarray) -> np.ndarray:
    """(n,) errors in standard deviations."""
    return curves.distances(made.curve.points_m, truth) / made.curve.sigma_m


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("truth", [along_x(), along_x(0.0004)], ids=["straight", "nearly"])
def test_a_dlo_along_the_way_of_the_camera(truth, seed):
    """36 mm wrong at a stated 6.9 mm, without a word: noise of the strand's direction was taken for
    evidence."""
    made, warning = found(truth, (-0.03, 0.0, 0.03), seed)
    assert believed(made, truth).max() < 2.0
    assert "runs along the way of the camera" in warning
    assert "across the DLO" in warning


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("step", [0.00015, 0.0003])
def test_a_camera_that_hardly_moved(step, seed):
    """238 mm wrong at a stated 5.7 mm."""
    made, warning = found(arc(), (-step, 0.0, step), seed)
    assert believed(made, arc()).max() < 1.0
    assert "Move it at least" in warning


@pytest.mark.parametrize("seed", range(3))
def test_a_dlo_across_the_way_is_as_sure_as_before(seed):
    made, warning = found(arc(), (-0.025, 0.0, 0.025), seed)
    assert warning is None
    assert 1000 * made.curve.sigma_m.mean() < 0.6
    assert believed(made, arc()).mean() < 1.2


@pytest.mark.parametrize("seed", range(3))
def test_a_dlo_that_swings_is_told_from_one_that_does_not(seed):
    """Mostly along the way of the camera, and yet seen."""
    truth = along_x(0.01)
    made, warning = found(truth, (-0.03, 0.0, 0.03), seed)
    assert warning is None
    assert made.curve.sigma_m.mean() < 0.005
    assert believed(made, truth).mean() < 1.5


@pytest.mark.parametrize("seed", range(3))
def test_the_published_method_refuses_what_lies_along_its_rows(seed):
    """Its answer was NaN."""
    views = views_of([along_x()], [above(x) for x in (-0.03, 0.0, 0.03)], seed, 0.15)
    with pytest.raises(NotReconstructable):
        dlo3ds.reconstruct(views, 1, 0, dlo3ds.Dlo3dsParams())


def test_the_published_method_refuses_equal_pictures_from_several_places():
    """Parallel rays meet nowhere."""
    views = views_of([arc()], [above(0.0)] * 3)
    moved = [type(v)(above(0.02 * k), v.strands, v.name) for k, v in enumerate(views)]
    with pytest.raises(NotReconstructable, match="parallel"):
        dlo3ds.reconstruct(moved, 1, 0, dlo3ds.Dlo3dsParams())


@pytest.mark.parametrize("tilt", [0.0, 1.0, 1.35])
def test_the_published_method_states_about_what_it_errs(tilt):
    """It took half a pixel as the least noise: 32 mm were stated on a DLO near its rows that was
    1.4 mm off."""
    truth = arc(bend=0.5) @ about(2, tilt).T
    views = views_of([truth], [above(x) for x in (-0.025, 0.0, 0.025)], 3, 0.15)
    made = dlo3ds.reconstruct(views, 1, 0, dlo3ds.Dlo3dsParams())
    assert 0.3 < np.sqrt(np.mean(believed(made, truth) ** 2)) < 1.2
