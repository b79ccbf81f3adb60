"""What holds for every instance method: one shape of result, and any mask is answered."""

from __future__ import annotations

from typing import get_args

import cv2
import numpy as np
import pytest
from dlo_client.contracts.methods import InstanceMethod

from models.instances.methods import METHODS, method
from models.instances.published import rt_dlo
from models.weights.inference import Network, Runtime, default_name, load
from tests.models.drawn_masks import assert_valid, circle, colored, drawn, loop

RED, BLUE = (200, 30, 30), (30, 40, 190)
DOWN = np.array([[60.0, 40.0], [260.0, 200.0]])
UP = np.array([[60.0, 200.0], [260.0, 40.0]])
# Ariadne+ is last: superpixels may fork where nothing does, so it is not asked for loops and rings.
NAMES = ("section_matching", "rt_dlo", "fastdlo", "ariadne_plus")


@pytest.fixture(scope="module")
def methods():
    def network(task: str) -> Network:
        return load(default_name(task), Runtime(threads=1))

    found = {name: method(name, network)[0] for name in NAMES}
    return {name: lambda mask, image=None, run=run: run(mask, image) for name, run in found.items()}


def test_every_method_is_a_row():
    assert set(METHODS) == set(NAMES) == set(get_args(InstanceMethod))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("red_on_top", [True, False])
def test_a_crossing_of_two_colors(methods, name, red_on_top):
    strands = [(DOWN, BLUE), (UP, RED)] if red_on_top else [(UP, RED), (DOWN, BLUE)]
    scene = methods[name](drawn(DOWN, UP), colored(*strands))
    assert len(scene.instances) == 2
    (crossing,) = scene.crossings
    assert np.hypot(crossing.xy[0] - 160, crossing.xy[1] - 120) < 5
    upper = scene.instances[crossing.over.instance - 1].centerline_xy
    falls = (upper[-1, 1] - upper[0, 1]) * (upper[-1, 0] - upper[0, 0]) > 0
    assert falls != red_on_top
    assert scene.labels[120, 160] == crossing.over.instance


@pytest.mark.parametrize("name", NAMES[:3])
def test_a_self_crossing_loop_is_one_instance(methods, name):
    """FASTDLO as released cannot: the loop is one segment with both ends at one crossing."""
    scene = methods[name](drawn(loop()))
    assert len(scene.instances) == 1
    assert len(scene.crossings) == 1


@pytest.mark.parametrize("name", NAMES[:3])
def test_a_ring_is_closed(methods, name):
    (ring,) = methods[name](drawn(circle((160, 120), 70))).instances
    assert ring.closed


@pytest.mark.parametrize("name", NAMES)
def test_another_size_of_picture_is_refused(methods, name):
    with pytest.raises(ValueError, match="does not belong"):
        methods[name](np.zeros((10, 10), bool), np.zeros((10, 11, 3), np.uint8))


def _noise(shape, share):
    return np.random.default_rng(5).random(shape) < share


def _disc(shape, radius):
    return cv2.circle(np.zeros(shape, np.uint8), (shape[1] // 2, shape[0] // 2), radius, 1, -1) > 0


def _grid(shape, step, width):
    lines = np.arange(max(shape)) % step < width
    return lines[: shape[0], None] | lines[None, : shape[1]]


def _cables(count, shape):
    rng, mask = np.random.default_rng(3), np.zeros(shape, np.uint8)
    for _ in range(count):
        cv2.polylines(mask, [rng.integers(0, shape[::-1], (4, 2)).astype(np.int32)], False, 1, 5)
    return mask > 0


UGLY = {
    "nothing": np.zeros((90, 120), bool),
    "everything": np.ones((90, 120), bool),
    "one pixel": _disc((90, 120), 0),
    "all but a pixel": ~_disc((90, 120), 0),
    "one by one": np.ones((1, 1), bool),
    "no pixels": np.zeros((0, 7), bool),
    "one row": np.ones((1, 200), bool),
    "salt and pepper": _noise((120, 200), 0.5),
    "sparse noise": _noise((200, 300), 0.05),
    "tiny noise": _noise((20, 20), 0.5),
    "disc": _disc((240, 320), 90),
    "grid": _grid((150, 200), 20, 4),
    "500 cables": _cables(500, (360, 640)),
    "checkers": np.indices((60, 60)).sum(0) % 2 == 0,
}


@pytest.mark.slow
@pytest.mark.parametrize("with_image", [True, False])
@pytest.mark.parametrize("mask", UGLY)
@pytest.mark.parametrize("name", NAMES)
def test_any_mask_gives_a_valid_scene(methods, name, mask, with_image):
    pixels = UGLY[mask]
    scene = methods[name](pixels, np.full((*pixels.shape, 3), 90, np.uint8) if with_image else None)
    assert_valid(scene, pixels)


@pytest.mark.parametrize("name", NAMES)
def test_a_huge_picture_is_answered_in_its_own_pixels(methods, name):
    mask = drawn(np.array([[400.0, 1500.0], [3600.0, 1500.0]]), width=60, shape=(3000, 4000))
    scene = methods[name](mask)
    assert scene.labels.shape == mask.shape
    longest = max(scene.instances, key=lambda i: i.length_px)
    assert np.abs(longest.centerline_xy[2:-2, 1] - 1500).max() < 10
    assert longest.length_px == pytest.approx(3260, abs=150)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "corners", [[[40, 40], [40, 160], [200, 160]], [[40, 40], [120, 160], [160, 40], [260, 160]]]
)
def test_a_bent_cable_is_one_or_unsure(methods, name, corners):
    """RT-DLO gave every leg as a cable of its own, all sure; Ariadne+ found nothing of the right
    angle."""
    instances = methods[name](drawn(np.array(corners), width=12)).instances
    assert instances
    assert len(instances) == 1 or min(i.score for i in instances) < 0.8


def test_a_kink_between_two_colors_stays_two_cables():
    left, right = (
        np.array([[40.0, 60.0], [160.0, 180.0]]),
        np.array([[160.0, 180.0], [280.0, 60.0]]),
    )
    scene = rt_dlo.extract(drawn(left, right), colored((left, RED), (right, BLUE)))
    assert len(scene.instances) == 2


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("widths", [3, 6, 14])
def test_a_short_bar_alone_in_a_mask_is_found_and_unsure(methods, name, widths):
    """Less likely a cable than not, it was left out, and the answer was empty."""
    (bar,) = methods[name](
        drawn(np.array([[60.0, 120.0], [60.0 + 12 * widths, 120.0]]), width=12)
    ).instances
    assert bar.length_px == pytest.approx(12 * (widths + 1), abs=12)
    assert bar.score < 0.8
