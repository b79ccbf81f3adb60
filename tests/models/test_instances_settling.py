"""A picture's foreground once its strands were looked at."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from models.instances.continuation import ContinuationParams, continued
from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.instances.settling import settle

SIZE = (240, 400)
COURSE = [(0, 150), (100, 120), (200, 120), (300, 150), (399, 140)]
WIDTH = 9


def drawn(courses: Sequence[Sequence[tuple[int, int]]], seed: int = 0) -> np.ndarray:
    """A picture of blue cables, lighter along their middle, on uneven ground."""
    rng = np.random.default_rng(seed)
    coarse = rng.normal(150, 10, (15, 25, 3)).astype(np.float32)
    picture = cv2.resize(coarse, SIZE[::-1], interpolation=cv2.INTER_CUBIC)
    for course in courses:
        for width, color in ((WIDTH, (40, 60, 150)), (WIDTH // 3, (70, 90, 185))):
            cv2.polylines(picture, [np.array(course, np.int32)], False, color, width, cv2.LINE_AA)
    return np.rint(np.clip(picture + rng.normal(0, 3, picture.shape), 0, 255)).astype(np.uint8)


def mask_of(course: Sequence[tuple[int, int]], until: int = 400) -> np.ndarray:
    mask = np.zeros(SIZE, np.uint8)
    cv2.polylines(mask, [np.array(course, np.int32)], False, 1, WIDTH)
    mask[:, until:] = 0
    return mask > 0


def added(
    picture: np.ndarray, seen: np.ndarray, chance: float = 1.0, certainty: float = 0.99
) -> np.ndarray:
    scene = extract(seen, picture)
    probability = np.where(seen, certainty, 0.01).astype(np.float32)
    return continued(scene, np.full(len(scene.instances), chance), probability, seen, picture)


def test_a_cable_that_breaks_off_is_continued_to_the_border() -> None:
    """The network saw one half of a cable and was sure that the other is none."""
    picture, whole, seen = drawn([COURSE]), mask_of(COURSE), mask_of(COURSE, until=250)
    found = added(picture, seen) | seen
    assert 2 * (found & whole).sum() / (found.sum() + whole.sum()) > 0.93
    assert 2 * (seen & whole).sum() / (seen.sum() + whole.sum()) < 0.8


def test_a_cable_seen_to_both_sides_of_what_is_lost_is_left_to_the_method() -> None:
    """Methods bridge a gap; their instance has no free end there."""
    seen = mask_of(COURSE)
    seen[:, 180:230] = False
    assert not added(drawn([COURSE]), seen).any()


ACROSS = [(258, 0), (246, 239)]
"""Of a cable over the one on COURSE."""


def test_a_cable_that_is_lost_where_another_covers_it_goes_on_behind_that_one() -> None:
    """Half of a cable was missing: the strand that covers it where it was lost was taken for its
    end."""
    picture, other, whole = drawn([COURSE, ACROSS]), mask_of(ACROSS), mask_of(COURSE)
    seen = mask_of(COURSE, until=238) | other
    found = added(picture, seen)
    assert (found & whole).sum() > 0.85 * (whole & ~seen).sum()
    assert (found & ~whole).sum() < 0.1 * found.sum()


def test_what_ends_under_another_cable_ends_there() -> None:
    course = [(0, 150), (100, 120), (238, 120)]
    seen = mask_of(course) | mask_of(ACROSS)
    assert not added(drawn([course, ACROSS]), seen).any()


@pytest.mark.parametrize(("other", "goes_on"), [(0.4, False), (1.0, True)])
def test_a_doubtful_one_is_continued_only_beside_a_cable(other: float, goes_on: bool) -> None:
    """A gray cable on gray ground, doubted and yet seen to go on, stayed half; alone it may be a
    joint."""
    beside = [(0, 40), (399, 50)]
    picture, seen = drawn([COURSE, beside]), mask_of(COURSE, until=250) | mask_of(beside)
    scene = extract(seen, picture)
    doubtful = [0.4 if i.centerline_xy[:, 1].mean() > 80 else other for i in scene.instances]
    probability = np.where(seen, 0.99, 0.01).astype(np.float32)
    assert continued(scene, np.array(doubtful), probability, seen, picture).any() == goes_on


def test_an_end_is_an_end() -> None:
    """A cable that ends in the picture, on ground that does not go on like it."""
    short = [(0, 150), (100, 120), (230, 120)]
    assert not added(drawn([short]), mask_of(short)).any()


def test_a_scratch_that_leads_nowhere_is_no_cable() -> None:
    """Something of its color goes on behind the end, but stops."""
    course = [(0, 150), (100, 120), (260, 120)]
    picture = drawn([course])
    assert not added(picture, mask_of(course, until=200)).any()


@pytest.mark.parametrize(
    ("chance", "certainty"), [(0.4, 0.99), (1.0, 0.7)], ids=["lookalike", "unsure"]
)
def test_what_may_be_no_cable_is_not_continued(chance: float, certainty: float) -> None:
    assert not added(drawn([COURSE]), mask_of(COURSE, until=250), chance, certainty).any()


def test_the_size_of_the_picture_does_not_matter() -> None:
    picture, whole, seen = drawn([COURSE]), mask_of(COURSE), mask_of(COURSE, until=250)
    larger = [np.repeat(np.repeat(a, 5, axis=0), 5, axis=1) for a in (picture, whole, seen)]
    found = added(larger[0], larger[2]) | larger[2]
    assert 2 * (found & larger[1]).sum() / (found.sum() + larger[1].sum()) > 0.93


def test_an_empty_scene_is_continued_by_nothing() -> None:
    nothing = np.zeros(SIZE, np.float32)
    scene = Scene((), (), np.zeros(SIZE, np.uint8))
    picture = np.zeros((*SIZE, 3), np.uint8)
    assert not continued(
        scene, np.zeros(0), nothing, nothing > 0, picture, ContinuationParams()
    ).any()


def test_probability_and_foreground_agree_once_settled() -> None:
    picture, seen = drawn([COURSE]), mask_of(COURSE, until=250)
    probability = np.where(seen, 0.99, 0.01).astype(np.float32)
    probability[10:20, 10:20] = 0.9  # a patch that did not count
    got = settle(picture, probability, seen, 0.5)
    assert np.array_equal(got.probability >= 0.5, got.cable)
    assert np.array_equal(np.rint(255 * got.probability) >= 127.5, got.cable)
    assert got.cable[:, 300:].any()
    assert len(got.scene.instances) == 1
    assert got.scene.instances[0].centerline_xy[:, 0].max() > 380


def test_what_is_hardly_a_cable_leaves_a_picture_without_any() -> None:
    """False pixels on tables without cables: straight edges that the network is not sure of."""
    picture, mask = drawn([]), mask_of([(100, 150), (200, 120)])
    probability = np.where(mask, 0.6, 0.01).astype(np.float32)
    got = settle(picture, probability, mask, 0.5)
    assert not got.cable.any()
    assert not got.scene.instances
    assert (got.probability < 0.5).all()


def speck() -> np.ndarray:
    mask = np.zeros(SIZE, np.uint8)
    cv2.line(mask, (330, 215), (338, 217), 1, WIDTH)
    return mask > 0


def test_pieces_too_short_for_an_instance_leave_a_picture_in_which_nothing_is_likely_a_cable() -> (
    None
):
    """The end of a railing at the picture's border stayed in the foreground: no instance, so nobody
    had rated it."""
    seen = speck()
    settled = settle(drawn([]), np.where(seen, 0.8, 0.01).astype(np.float32), seen, 0.5)
    assert not settled.cable.any()
    assert (settled.probability < 0.5).all()


def test_pieces_beside_a_cable_stay() -> None:
    """They may be the rest of a cable that the network hardly sees."""
    seen = speck() | mask_of(COURSE)
    settled = settle(drawn([COURSE]), np.where(seen, 0.99, 0.01).astype(np.float32), seen, 0.5)
    assert settled.cable[speck()].all()


def test_a_slab_that_fills_a_good_part_of_the_picture_stays() -> None:
    """A network of somebody's own sees what it was trained to see; no method finds an instance
    there."""
    seen = np.zeros(SIZE, bool)
    seen[:, :150] = True
    settled = settle(drawn([]), np.where(seen, 0.99, 0.01).astype(np.float32), seen, 0.5)
    assert settled.cable[seen].all()
