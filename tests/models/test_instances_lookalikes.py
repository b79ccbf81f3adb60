"""What is no cable is left out or doubted, by what is seen along it."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest

from models.instances.likeness import Likeness, likeness
from models.instances.lookalikes import (
    COEFFICIENTS,
    Calibration,
    calibration,
    chances,
    hardly,
    without_lookalikes,
)
from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.training.instances.lookalikes import Seen, fit

SIZE = (240, 400)
COURSES = {1: [(20, 60), (380, 90)], 2: [(20, 190), (380, 170)], 3: [(200, 10), (210, 230)]}


def strands() -> tuple[Scene, np.ndarray, np.ndarray, np.ndarray]:
    """Three strands, the third across both others: scene, probability, mask, picture. The network
    is unsure of the second."""
    ids = np.zeros(SIZE, np.uint8)
    picture = np.full((*SIZE, 3), 60, np.uint8)
    for k, course in COURSES.items():
        cv2.polylines(ids, [np.array(course, np.int32)], False, k, 9)
    picture[ids > 0] = (200, 180, 40)
    probability = np.select([ids == 2, ids > 0], [0.55, 0.99], 0.01).astype(np.float32)
    return extract(ids > 0, picture), probability, ids > 0, picture


def rule(least: float) -> Calibration:
    """A cable is what the network is certain of."""
    names = Likeness._fields
    hidden = 0.5 * np.array([[name == "certainty"] for name in names])
    mean, scale = np.zeros(len(names)), np.ones(len(names))
    return Calibration(mean, scale, hidden, np.array([-0.5]), np.array([4.0]), 0.0, least)


def test_what_the_network_hardly_sees_is_left_out_and_the_rest_is_numbered_anew() -> None:
    scene, probability, mask, picture = strands()
    assert len(scene.instances) == 3
    assert len(scene.crossings) == 2
    found = without_lookalikes(scene, probability, mask, picture, rule(0.5))
    assert len(found.instances) == 2
    assert set(np.unique(found.labels)) == {0, 1, 2}
    assert len(found.crossings) == 1
    assert {found.crossings[0].over.instance, found.crossings[0].under.instance} == {1, 2}
    for number, instance in enumerate(found.instances, start=1):
        x, y = np.rint(instance.centerline_xy[len(instance.centerline_xy) // 4]).astype(int)
        assert found.labels[y, x] == number
    assert all(abs(i.centerline_xy[:, 1].mean() - 180) > 20 for i in found.instances)


def test_a_doubtful_one_stays_with_a_low_score_and_the_reason() -> None:
    scene, probability, mask, picture = strands()
    probability[probability == np.float32(0.55)] = 0.8
    found = without_lookalikes(scene, probability, mask, picture, rule(0.0))
    assert len(found.instances) == 3
    doubted = [i for i in found.instances if "lookalike" in i.reasons]
    assert len(doubted) == 1
    assert abs(doubted[0].centerline_xy[:, 1].mean() - 180) < 12
    assert doubted[0].score < min(i.score for i in found.instances if "lookalike" not in i.reasons)


def test_doubt_alone_leaves_no_picture_empty() -> None:
    scene, probability, mask, picture = strands()
    probability[mask] = 0.55
    assert len(without_lookalikes(scene, probability, mask, picture, rule(0.0)).instances) == 3
    assert not without_lookalikes(scene, probability, mask, picture, rule(0.49)).instances


def test_what_lies_alone_is_hardly_a_cable_at_half_the_probability() -> None:
    """A straight cable alone on a table was answered with nothing."""
    least = rule(0.2)
    assert hardly(np.array([0.15]), least).tolist() == [False]
    assert hardly(np.array([0.15, 0.3]), least).tolist() == [False, False]
    assert hardly(np.array([0.15, 0.6]), least).tolist() == [True, False]
    assert hardly(np.array([0.05]), least).tolist() == [True]


@pytest.mark.parametrize(
    ("course", "kept"),
    [
        ([(394, 0), (394, 239)], False),
        ([(385, 0), (385, 239)], True),
        ([(396, 0), (396, 110), (200, 200)], True),
    ],
)
def test_a_strip_along_the_border_is_no_cable(course: list[tuple[int, int]], kept: bool) -> None:
    """The margin of a poster that ends beside the picture's border was a sure cable: it shows one
    edge only."""
    picture = np.full((*SIZE, 3), 60, np.uint8)
    mask = np.zeros(SIZE, np.uint8)
    cv2.polylines(mask, [np.array(course, np.int32)], False, 1, 10)
    picture[mask > 0] = (200, 180, 40)
    scene = extract(mask > 0, picture)
    assert len(scene.instances) == 1
    found = without_lookalikes(
        scene, np.where(mask, 0.99, 0.01).astype(np.float32), mask > 0, picture, rule(0.2)
    )
    assert bool(found.instances) == kept


def test_nothing_changes_in_an_empty_scene() -> None:
    scene = Scene((), (), np.zeros(SIZE, np.uint8))
    nothing = np.zeros(SIZE, np.float32)
    assert without_lookalikes(scene, nothing, nothing > 0, np.zeros((*SIZE, 3), np.uint8)) is scene


@pytest.mark.parametrize("points", [1, 2])
def test_evidence_of_the_shortest_lines_is_finite(points: int) -> None:
    scene, probability, mask, picture = strands()
    short = replace(
        scene.instances[0], centerline_xy=scene.instances[0].centerline_xy[:points], length_px=0.0
    )
    rows = likeness(
        replace(scene, instances=(short,), crossings=()), probability, mask, picture
    ).rows()
    assert rows.shape == (1, len(Likeness._fields))
    assert np.isfinite(rows).all()


def test_the_shipped_rule_has_the_names_of_the_evidence() -> None:
    table = tomllib.loads(COEFFICIENTS.read_text())
    assert tuple(table["evidence"]) == Likeness._fields
    assert 0 < calibration().least < 0.5


def test_the_shipped_rule_believes_a_certain_network_more() -> None:
    scene, probability, mask, picture = strands()
    likely = chances(scene, probability, mask, picture)
    second = int(np.argmin([abs(i.centerline_xy[:, 1].mean() - 180) for i in scene.instances]))
    assert likely.argmin() == second


@pytest.mark.slow
def test_the_fit_finds_what_tells_them_apart() -> None:
    rng = np.random.default_rng(4)
    seen = []
    for _ in range(400):
        rows = rng.normal(size=(6, len(Likeness._fields)))
        seen.append(Seen(rows, rows[:, 1] > 0.3, np.ones(6)))
    table = fit(seen)
    held = table["held_out"]
    assert isinstance(held, dict)
    assert held["others_left_out"] > 0.6
    assert held["cables_left_out"] < 0.15
    assert held["calibration_error"] < 0.2
