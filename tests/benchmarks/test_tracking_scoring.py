"""Identity over a clip, on curves that can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.tracking_scoring import Identities, dense

LINE = dense(np.array([[0.0, 0.0], [300.0, 0.0]]))
"""(100, 2) points of a cable."""


def test_an_id_that_stays_on_its_cable_is_kept_although_another_one_is_on_more_of_it() -> None:
    """CLEAR MOT: of two that are on a cable the one it was found with last is kept; the other one
    is a false one."""
    scores = Identities(width_px=5.0)
    for t in range(10):
        assert scores.add(
            {0: LINE}, {4: LINE[:60], 7: LINE[30 - 5 * (t % 2) :]} if t else {4: LINE}
        ) == {0: 4}
    assert scores.switches == 0
    assert scores.idf1() == pytest.approx(200 * 10 / (10 + 19))


def test_an_id_that_left_its_cable_is_a_switch_and_so_is_its_return() -> None:
    scores = Identities(width_px=5.0)
    frames = [{4: LINE}, {4: LINE[:20], 7: LINE}, {}, {7: LINE}, {4: LINE}]
    assert [scores.add({0: LINE}, frame) for frame in frames] == [
        {0: 4},
        {0: 7},
        {},
        {0: 7},
        {0: 4},
    ]
    assert scores.switches == 2


def test_ids_exchanged_between_two_cables_are_two_switches() -> None:
    scores, other = Identities(width_px=5.0), LINE + np.array([0.0, 100.0])
    for first, second in ((1, 2), (2, 1), (2, 1)):
        scores.add({0: LINE, 1: other}, {first: LINE, second: other})
    assert scores.switches == 2
