"""Pictures of the empty place: light, shadows and small shifts explain nothing away, cables stand
out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from models.segmentation.empty_place import align, weigh

SIZE = (180, 320)


def ground(seed: int = 0) -> np.ndarray:
    """Speckle of several sizes with dark rails, larger than the picture."""
    rng = np.random.default_rng(seed)
    out = np.full((SIZE[0] + 40, SIZE[1] + 40, 3), 120, np.float32)
    for cells in (6, 30, 120):
        noise = rng.normal(0, 14, (cells, cells, 3)).astype(np.float32)
        out += cv2.resize(noise, out.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    out[60:68] *= 0.5
    out[:, 100:108] *= 0.6
    return out


def taken(
    place: np.ndarray, shift: tuple[float, float] = (0, 0), gain: float = 1.0, seed: int = 1
) -> np.ndarray:
    warp = np.array([[1, 0, -20 + shift[0]], [0, 1, -20 + shift[1]]], np.float32)
    cut = cv2.warpAffine(place, warp, SIZE[::-1])
    noise = np.random.default_rng(seed).normal(0, 2, cut.shape)
    return np.clip(cut * gain + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def scene():
    """The place with a cable, where it is, and what an unsure network sees: the cable faintly, a
    rail as clearly."""
    place, mask = ground(), np.zeros((SIZE[0] + 40, SIZE[1] + 40), np.uint8)
    cv2.line(mask, (30, 180), (340, 90), 1, 9)
    with_cable = place.copy()
    with_cable[mask > 0] = (60, 90, 160)
    cut = mask[20:-20, 20:-20] > 0
    probability = np.full(SIZE, 0.02, np.float32)
    probability[cut] = 0.45
    probability[40:48] = 0.7
    return place, with_cable, cut, probability


def shadowed(place: np.ndarray) -> np.ndarray:
    shade = np.ones(place.shape[:2], np.float32)
    cv2.rectangle(shade, (140, 0), (260, 300), 0.55, -1)
    return place * cv2.GaussianBlur(shade, (0, 0), 3)[:, :, None]


TAKEN = [((0, 0), 1.0, False), ((4.3, -2.6), 1.0, False), ((0, 0), 0.7, False), ((2, 1), 1.2, True)]


@pytest.mark.parametrize(("shift", "gain", "shadow"), TAKEN)
def test_a_cable_stands_out_and_what_was_always_there_does_not(scene, shift, gain, shadow) -> None:
    place, with_cable, cut, probability = scene
    picture = taken(shadowed(with_cable) if shadow else with_cable, gain=gain)
    weighed = weigh(picture, probability, [taken(place, shift, seed=2)])
    assert weighed.reason is None
    assert weighed.shift_px == pytest.approx(np.hypot(*shift), abs=0.7)
    found = weighed.probability >= 0.5
    assert found[cut].mean() > 0.85
    assert found[~cut].mean() < 0.03
    assert weighed.relied > 0.2
    assert 0.7 < weighed.agreement < 1


def test_another_place_changes_nothing_and_says_why(scene) -> None:
    _, with_cable, _, probability = scene
    weighed = weigh(taken(with_cable), probability, [taken(ground(9)[::-1, ::-1], seed=2)])
    assert weighed.reason is not None
    assert weighed.probability is probability
    assert (weighed.relied, weighed.agreement) == (0.0, 0.0)


def test_of_several_pictures_the_one_that_fits_counts(scene) -> None:
    place, with_cable, cut, probability = scene
    weighed = weigh(
        taken(with_cable), probability, [taken(ground(9)[::-1, ::-1]), taken(place, (3, 3), seed=2)]
    )
    assert weighed.reason is None
    assert (weighed.probability >= 0.5)[cut].mean() > 0.85


def test_where_the_place_was_not_seen_the_network_decides(scene) -> None:
    place, with_cable, _, probability = scene
    weighed = weigh(taken(with_cable), probability, [taken(place, (12, 0), seed=2)])
    assert weighed.reason is None
    np.testing.assert_allclose(weighed.probability[:, -8:], probability[:, -8:], atol=1e-4)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_pictures_of_one_color_are_no_place(level: int) -> None:
    plain = np.full((*SIZE, 3), level, np.uint8)
    probability = np.full(SIZE, 0.3, np.float32)
    assert weigh(plain, probability, [plain]).probability is probability
    assert isinstance(align(plain, plain, np.ones(SIZE, bool)), str)


def test_a_picture_full_of_cables_leaves_nothing_to_align_by(scene) -> None:
    place, with_cable, _, _ = scene
    weighed = weigh(taken(with_cable), np.full(SIZE, 0.9, np.float32), [taken(place)])
    assert weighed.reason is not None


def test_pictures_smaller_than_anything_are_survived() -> None:
    for size in ((1, 1), (3, 200), (9, 9)):
        picture = np.random.default_rng(0).integers(0, 255, (*size, 3), dtype=np.uint8)
        weighed = weigh(picture, np.full(size, 0.3, np.float32), [picture])
        assert np.isfinite(weighed.probability).all()
        assert weighed.probability.shape == size


def test_a_large_picture_keeps_its_size_and_its_thin_cable(scene) -> None:
    place, with_cable, cut, probability = scene
    factor = 5
    size = (SIZE[1] * factor, SIZE[0] * factor)
    large = cv2.resize(taken(with_cable), size, interpolation=cv2.INTER_CUBIC)
    before = cv2.resize(taken(place, (1, 1), seed=2), size, interpolation=cv2.INTER_CUBIC)
    weighed = weigh(large, cv2.resize(probability, size), [before])
    assert weighed.probability.shape == size[::-1]
    assert weighed.shift_px == pytest.approx(factor * 2**0.5, rel=0.3)
    assert (weighed.probability >= 0.5)[cv2.resize(cut.astype(np.uint8), size) > 0].mean() > 0.8
