"""The simulated world that the disentangling planner learns from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.disentangling.evidence import MOVE_FEATURES
from models.disentangling.rigid_piece import Pivot
from models.geometry.polylines import arc_lengths, resample
from models.synthesis.harness import FREE, Harness, TrueSection
from models.synthesis.harness_curves import meetings
from models.training.disentangling.moves import moves_table
from models.training.disentangling.table_world import (
    _turned,
    one_crossing,
    unclear,
)
from tests.models.harnesses import section, shipped

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured


def harness_of(*lines: list[tuple[float, float]]) -> Harness:
    sections = tuple(TrueSection(section(line).xy, 8.0, (FREE, FREE)) for line in lines)
    sections = tuple(
        replace(s, xy=resample(s.xy, round(float(arc_lengths(s.xy)[-1]) / 3) + 1)) for s in sections
    )
    met = tuple(meetings([s.xy for s in sections]))
    return Harness((480, 640), sections, np.zeros((0, 2)), met, tuple(True for _ in met))


def test_what_nobody_could_read_from_a_mask_is_counted():
    assert unclear(harness_of([(100, 240), (500, 240)], [(300, 100), (300, 400)])) == 0
    assert unclear(harness_of([(100, 240), (500, 240)], [(300, 100), (300, 232)])) == 1, (
        "an end touches"
    )
    assert unclear(harness_of([(2, 100), (2, 400)], [(-20, 240), (200, 240)])) == 1, (
        "a crossing at the border"
    )
    near = harness_of([(100, 240), (500, 240)], [(300, 100), (300, 400)], [(310, 100), (310, 400)])
    assert unclear(near) >= 2, "two crossings next to each other, and sections side by side"


def test_random_scenes_are_easy_to_read():
    assert sum(unclear(one_crossing(np.random.default_rng([22, k]), 3)) for k in range(10)) == 0


def test_turns_are_tried_in_the_world_to_learn_from():
    network, classifiers = shipped()
    table, again = (moves_table(31, 0, 3, network, classifiers) for _ in range(2))
    assert table.rows.shape == (len(table), len(MOVE_FEATURES))
    assert 0 < table.truths.mean() < 1
    assert np.array_equal(table.rows, again.rows)
    assert np.array_equal(table.truths, again.truths)


def test_what_was_moved_lies_on_top_of_its_own_section_too():
    harness = harness_of([(100, 100), (400, 100), (400, 200), (150, 200)])
    turned_over = _turned(harness, Pivot(0, 400.0, 1, -1), [], np.array([400.0, 200.0]), np.pi / 4)
    assert len(turned_over.crossings) == 1
    assert turned_over.a_over == (False,), "the second pass was moved"
