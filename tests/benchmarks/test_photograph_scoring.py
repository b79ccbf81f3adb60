"""The score of hand-marked photographs on drawn ones with known shares."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.photograph_scoring import Share, Stroke, mean_shares, score_photograph


def drawn() -> tuple[list[Stroke], np.ndarray]:
    """One cable of 6 px along row 30 of a picture of 60 × 100."""
    labels = np.zeros((60, 100), np.uint8)
    labels[27:33] = 255
    xy = np.column_stack([np.arange(0, 100.0, 2), np.full(50, 30.0)])
    return [Stroke(xy, np.full(50, 6.0))], labels


def test_the_truth_itself_has_every_share() -> None:
    strokes, labels = drawn()
    assert score_photograph(labels == 255, strokes, labels) == Share(1.0, 1.0, 1.0)


def test_half_a_cable_is_found_to_one_half() -> None:
    strokes, labels = drawn()
    found = labels == 255
    found[:, 50:] = False
    share = score_photograph(found, strokes, labels)
    assert share.found == pytest.approx(0.5, abs=0.06)  # half a width further still counts
    assert share.right == 1.0
    assert share.dice == pytest.approx(2 / 3)


def test_what_is_no_cable_costs_the_share_that_is_right() -> None:
    strokes, labels = drawn()
    found = labels == 255
    found[5:11] = True
    share = score_photograph(found, strokes, labels)
    assert share.found == 1.0
    assert share.right == pytest.approx(0.5, abs=0.05)


def test_what_cannot_be_told_counts_nowhere() -> None:
    strokes, labels = drawn()
    found = labels == 255
    found[40:50] = True
    labels[38:52] = 128
    labels[:, :20] = 128
    assert score_photograph(found, strokes, labels) == Share(1.0, 1.0, 1.0)


def test_an_empty_answer_finds_nothing_and_says_nothing_of_what_is_right() -> None:
    strokes, labels = drawn()
    share = score_photograph(np.zeros_like(labels, bool), strokes, labels)
    assert share == Share(0.0, None, 0.0)
    assert mean_shares([share, Share(1.0, 0.8, 0.5)]) == {
        "found": 50.0,
        "right": 80.0,
        "dice": 25.0,
    }
