"""Orientation of patches: the analytic axis, the network's shape, its labels, and the exported
file."""

from __future__ import annotations

import numpy as np
import pytest

from models.instances.published.rt_dlo.orientation import (
    CLASSES,
    PATCH_SIZE,
    angles_from_scores,
    principal_angles,
    read_patches,
)
from models.strands.foreground import distance_map
from tests.models.drawn_masks import drawn


def bar_patch(degrees: float, width: int = 9) -> np.ndarray:
    """``(1, s, s)`` patch in the middle of a bar of this direction."""
    step = 90 * np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    center = np.array([100.0, 100.0])
    distances = distance_map(
        drawn(np.array([center - step, center + step]), width=width, shape=(201, 201))
    )
    return read_patches(distances, center[None], np.array([width / 2]))


def off_by(found: float, degrees: float) -> float:
    away = abs(np.rad2deg(found) - degrees) % 180
    return min(away, 180 - away)


@pytest.mark.parametrize("width", [5, 9, 21])
@pytest.mark.parametrize("degrees", [0, 17, 45, 90, 120, 179])
def test_main_axis_of_a_bar(degrees, width):
    assert off_by(principal_angles(bar_patch(degrees, width))[0], degrees) < 3


def test_patches_are_measured_in_radii():
    """The same bar at twice the size gives nearly the same patch."""
    small, large = bar_patch(30, 10)[0], bar_patch(30, 20)[0]
    assert np.abs(small - large).mean() < 0.1


def test_patches_beyond_the_picture_are_zero():
    distances = np.ones((30, 30), np.float32)
    patch = read_patches(distances, np.array([[0.0, 0.0]]), np.array([1.0]))[0]
    assert patch[:7].max() == 0
    assert patch[7:, 7:].min() == 1


def test_class_is_a_degree():
    scores = np.zeros((2, CLASSES), np.float32)
    scores[0, 0], scores[1, 135] = 1, 1
    np.testing.assert_allclose(np.rad2deg(angles_from_scores(scores)), [0, 135])


def test_shipped_network_beats_the_main_axis_on_patches_it_never_saw():
    pytest.importorskip("onnxruntime")
    from models.training.instances.rt_dlo_patches import make_patches
    from models.weights.inference import Runtime, load

    network = load("rt_dlo_orientation", Runtime(threads=1))
    patches, angles = make_patches(1500, np.random.default_rng(99))

    def error(found):
        away = np.mod(np.rad2deg(found - angles), 180)
        return np.minimum(away, 180 - away).mean()

    assert error(angles_from_scores(network(patches))) < min(5.0, error(principal_angles(patches)))


def test_training_labels_are_gaussian_and_periodic():
    pytest.importorskip("torch")
    from models.training.instances.rt_dlo_orientation import encode_angles

    targets = encode_angles(np.deg2rad([1.0, 90.0]), 4.0).numpy()
    assert targets.shape == (2, CLASSES)
    assert targets.argmax(axis=1).tolist() == [1, 90]
    assert targets[0, 179] == pytest.approx(targets[0, 3])  # both two degrees away


def test_network_answers_one_patch_as_in_a_batch():
    torch = pytest.importorskip("torch")
    from models.training.instances.rt_dlo_network_orientation import OrientationNetwork

    network = OrientationNetwork().eval()
    patches = torch.rand(5, PATCH_SIZE, PATCH_SIZE, generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        batch = network(patches)
        single = torch.cat([network(p[None]) for p in patches])
    assert batch.shape == (5, CLASSES)
    torch.testing.assert_close(batch, single)
