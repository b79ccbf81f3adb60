"""What is expected of turns after some were carried out."""

from __future__ import annotations

import numpy as np
import pytest

from models.disentangling.expectations import Attempt, updated
from models.disentangling.plan import DisentangleParams, plan
from models.weights.inference import Runtime, default_name, load
from tests.models.harnesses import crossed

SCORES = np.array([0.8, 0.8, 0.8])
HOLDS = np.array([[0.0, 0.0], [0.0, 0.5], [9.0, 0.0]])
TURNS = np.array([1.0, 1.1, 1.0])


def test_without_attempts_nothing_changes():
    assert updated(SCORES, HOLDS, TURNS, []) is SCORES


def test_a_failed_turn_is_expected_less_and_others_a_little_less():
    again, alike, elsewhere = updated(
        SCORES, HOLDS, TURNS, [Attempt((0, 0), 1.0, 0.8, worked=False)]
    )
    assert again == alike < 0.5
    assert 0.6 < elsewhere < 0.8


def test_the_other_way_round_is_another_turn():
    after = updated(SCORES, HOLDS, -TURNS, [Attempt((0, 0), 1.0, 0.8, worked=False)])
    assert after == pytest.approx(after[2])


def test_what_worked_as_expected_changes_little_and_more_often_than_expected_raises():
    assert updated(
        SCORES, HOLDS, TURNS, [Attempt((9, 9), 0.0, 0.95, worked=True)]
    ) == pytest.approx(SCORES, abs=0.01)
    assert updated(SCORES, HOLDS, TURNS, 5 * [Attempt((9, 9), 0.0, 0.5, worked=True)]).min() > 0.88


def test_the_planner_turns_to_something_else_after_a_failure():
    """The same turn was proposed for ever, with the probability that had already proved wrong."""
    moves = load(default_name("moves"), Runtime(threads=1))
    first = plan(crossed(), moves)[0]
    failed = Attempt(first.hold.xy, first.turn, first.score, worked=False)
    again = plan(crossed(), moves, DisentangleParams(attempts=3 * [failed]))
    assert all(a.score < first.score for a in again)
    best = again[0]
    moved_on = (
        np.hypot(*np.subtract(best.hold.xy, first.hold.xy)) > 1 or abs(best.turn - first.turn) > 0.5
    )
    assert moved_on
