"""The benchmark's own scores on label images that can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.scoring import (
    FoundCrossing,
    crossings_in_labels,
    score_crossings,
    score_labels,
)


def test_identical_labels_with_other_ids_are_perfect():
    true = np.array([[1, 1, 0, 2, 2, 2]])
    predicted = np.array([[7, 7, 0, 3, 3, 3]])
    assert score_labels(predicted, true) == dict.fromkeys(
        ("iou", "iou_strict", "dice", "pq", "count", "sem_dice"), 1.0
    )


def test_an_extra_instance_costs_only_strict_scores():
    true = np.array([[1, 1, 1, 1, 0, 0]])
    predicted = np.array([[1, 1, 0, 0, 2, 2]])
    scores = score_labels(predicted, true)
    assert scores["iou"] == 0.5
    assert scores["iou_strict"] == 0.25
    assert scores["dice"] == pytest.approx(2 / 3)
    assert scores["pq"] == 0  # 0.5 is no match: it has to be above
    assert scores["count"] == 0
    assert scores["sem_dice"] == 0.5


def test_nothing_found_is_zero_and_nothing_there_is_counted():
    empty, one = np.zeros((2, 3), int), np.array([[1, 1, 0], [0, 0, 0]])
    assert score_labels(empty, one)["iou"] == 0
    assert score_labels(empty, empty)["count"] == 1


def crossing_labels() -> np.ndarray:
    labels = np.zeros((60, 80), int)
    labels[25:35] = 1
    labels[:, 35:45] = np.where(labels[:, 35:45] == 1, 1, 2)  # 2 is interrupted by 1
    return labels


def test_interrupted_label_is_the_lower_strand():
    (crossing,) = crossings_in_labels(crossing_labels())
    assert (crossing.over, crossing.under) == (1, 2)
    assert crossing.xy[1] == pytest.approx(29.5, abs=1)
    assert 35 <= crossing.xy[0] <= 45


@pytest.mark.parametrize(("over", "right"), [(1, True), (2, False)])
def test_order_is_compared_under_the_ids_of_the_truth(over, right):
    true = crossing_labels()
    predicted = np.where(true == 1, 2, np.where(true == 2, 1, 0))
    found = [FoundCrossing(np.array([41.0, 31.0]), 3 - over, over, 0.8)]
    result = score_crossings(found, crossings_in_labels(true), predicted, true)
    assert (result["true"], result["predicted"], result["found"]) == (1, 1, 1)
    assert result["orders"] == [(0.8, right)]
