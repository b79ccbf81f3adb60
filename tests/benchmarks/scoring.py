"""Scores of predicted instances against true label images, by the project's frozen definition.

Per image, predicted and true instances are matched one to one so that the sum of IoU is largest
(Hungarian):

    iou         sum of matched IoU / true instances
    iou_strict  the same sum / max(true, predicted): extra instances cost
    dice        sum of matched Dice / true instances
    pq          panoptic quality (matches above IoU 0.5)
    count       1 when the number of instances is right
    sem_dice    Dice of the union of all instances
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

CROSSING_RADIUS_PX = 15.0


def score_labels(predicted: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Scores of one image; ``predicted`` and ``true``: ``(H, W)`` integers, 0 = background."""
    if predicted.shape != true.shape:
        size = true.shape[::-1]
        predicted = cv2.resize(
            predicted.astype(np.float64), size, interpolation=cv2.INTER_NEAREST
        ).astype(np.int64)
    iou, dice = _overlaps(predicted, true)
    n_true, n_predicted = iou.shape
    rows, columns = linear_sum_assignment(-iou)
    matched = iou[rows, columns]
    good = matched[matched > 0.5]
    both = np.count_nonzero((predicted > 0) & (true > 0))
    either = np.count_nonzero(predicted) + np.count_nonzero(true)
    return {
        "iou": float(matched.sum()) / max(n_true, 1),
        "iou_strict": float(matched.sum()) / max(n_true, n_predicted, 1),
        "dice": float(dice[rows, columns].sum()) / max(n_true, 1),
        "pq": float(good.sum()) / max((n_true + n_predicted) / 2, 1e-9),
        "count": float(n_true == n_predicted),
        "sem_dice": 2 * both / max(either, 1),
    }


def _overlaps(predicted: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """IoU and Dice of every true (row) with every predicted (column) instance."""
    true_ids, true_index = np.unique(true, return_inverse=True)
    predicted_ids, predicted_index = np.unique(predicted, return_inverse=True)
    shape = (len(true_ids), len(predicted_ids))
    table = np.bincount(
        true_index.ravel() * shape[1] + predicted_index.ravel(), minlength=shape[0] * shape[1]
    )
    table = table.reshape(shape).astype(float)
    areas = table.sum(axis=1, keepdims=True) + table.sum(axis=0, keepdims=True)
    shared = table[true_ids != 0][:, predicted_ids != 0]
    areas = areas[true_ids != 0][:, predicted_ids != 0]
    return shared / np.maximum(areas - shared, 1), 2 * shared / np.maximum(areas, 1)


@dataclass(frozen=True, eq=False)
class LabelCrossing:
    """A crossing as labels show it: where, whose pixels lie there, and who is interrupted there."""

    xy: np.ndarray
    over: int
    under: int


def crossings_in_labels(true: np.ndarray, *, least_area: int = 30) -> list[LabelCrossing]:
    """Places where one instance's pixels interrupt another instance: the upper DLO owns the pixels.

    An instance's parts are compared pairwise; two parts with one other instance between their
    nearest points are a crossing. Self-crossings do not show in labels.
    """
    found = []
    for under in np.unique(true[true > 0]):
        count, parts, stats, _ = cv2.connectedComponentsWithStats((true == under).astype(np.uint8))
        big = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= least_area]
        outlines = {k: np.argwhere(parts == k)[:, ::-1].astype(float) for k in big}
        for a, b in combinations(big, 2):
            crossing = _between(outlines[a], outlines[b], true, int(under))
            if crossing is not None:
                found.append(crossing)
    return found


def _between(
    a_xy: np.ndarray, b_xy: np.ndarray, true: np.ndarray, under: int
) -> LabelCrossing | None:
    apart, nearest = cKDTree(b_xy).query(a_xy)
    first = int(np.argmin(apart))
    start, stop = a_xy[first], b_xy[nearest[first]]
    line = np.rint(start + np.linspace(0, 1, 64)[:, None] * (stop - start)).astype(int)
    owners = true[line[:, 1], line[:, 0]]
    owners = owners[owners != under]
    over = int(np.bincount(owners).argmax()) if len(owners) else 0
    if over == 0 or apart[first] > 80 or (owners == over).mean() < 0.6:
        return None
    return LabelCrossing((start + stop) / 2, over, under)


@dataclass(frozen=True, eq=False)
class FoundCrossing:
    """A predicted crossing of two instances, their ids in the predicted labels, and the order's
    score."""

    xy: np.ndarray
    over: int
    under: int
    score: float


def _main_label(owners: np.ndarray) -> int:
    owners = owners[owners > 0]
    return int(np.bincount(owners).argmax()) if len(owners) else 0


def score_crossings(
    found: list[FoundCrossing],
    true_crossings: list[LabelCrossing],
    predicted: np.ndarray,
    true: np.ndarray,
) -> dict[str, object]:
    """Counts of one image: true, predicted, found within 15 px; ``orders``: (score, right) of each
    found.

    Predicted ids become true ids by the largest overlap.
    """
    name = {int(i): _main_label(true[predicted == i]) for i in np.unique(predicted[predicted > 0])}
    orders, left = [], list(found)
    for truth in true_crossings:
        near = sorted(left, key=lambda f: float(np.hypot(*(f.xy - truth.xy))))
        if near and np.hypot(*(near[0].xy - truth.xy)) <= CROSSING_RADIUS_PX:
            left.remove(near[0])
            right = name.get(near[0].over) == truth.over and name.get(near[0].under) == truth.under
            orders.append((near[0].score, right))
    return {
        "true": len(true_crossings),
        "predicted": len(found),
        "found": len(orders),
        "orders": orders,
    }
