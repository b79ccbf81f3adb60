"""Identity over a clip: IDF1, switches, and how far a point drifts along its cable."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

NEAR_WIDTHS = 1.0
"""A point so near to the other curve is on it."""
LEAST_SHARED = 0.5
"""A cable is found where this F1 of its points in view and those found is reached: as IoU above a
third."""
LEAST_VISIBLE = 0.3
"""A cable of which less is in view need not be found in a frame."""


class Identities:
    """Counts, frame by frame, which predicted id is on which true cable."""

    def __init__(self, width_px: float) -> None:
        self.width_px = width_px
        self.pairs: Counter[tuple[int, int]] = Counter()
        self.true = self.predicted = self.switches = 0
        self._last: dict[int, int] = {}

    def add(
        self, true: Mapping[int, np.ndarray], predicted: Mapping[int, np.ndarray]
    ) -> dict[int, int]:
        """Dense points (n, 2) in view of ``true`` and ``predicted`` cables by id; returns predicted
        by true id in this frame. As CLEAR MOT defines it, a cable keeps the id that it was last
        found with while that is on it, and a switch is a frame in which it is found with another
        one."""
        self.true += len(true)
        self.predicted += len(predicted)
        if not true or not predicted:
            return {}
        keys, others = list(true), list(predicted)
        shared = shared_points(
            [true[k] for k in keys], [predicted[k] for k in others], NEAR_WIDTHS * self.width_px
        )
        kept = np.array([[self._last.get(k) == j for j in others] for k in keys])
        rows, columns = linear_sum_assignment(-np.where(shared > LEAST_SHARED, shared + kept, 0.0))
        found = {
            keys[i]: others[j]
            for i, j in zip(rows, columns, strict=True)
            if shared[i, j] > LEAST_SHARED
        }
        for cable, number in found.items():
            self.pairs[cable, number] += 1
            self.switches += cable in self._last and self._last[cable] != number
        self._last |= found
        return found

    def idf1(self) -> float:
        """Percent."""
        keys, others = sorted({a for a, _ in self.pairs}), sorted({b for _, b in self.pairs})
        counts = np.array([[self.pairs[a, b] for b in others] for a in keys])
        if not counts.size:
            return 0.0
        rows, columns = linear_sum_assignment(-counts)
        return float(200 * counts[rows, columns].sum() / (self.true + self.predicted))


def shared_points(
    true: Sequence[np.ndarray], predicted: Sequence[np.ndarray], near_px: float
) -> np.ndarray:
    """F1 of the points of every true and every predicted curve, ``near_px`` from one another."""
    out = np.zeros((len(true), len(predicted)))
    trees = [cKDTree(points) for points in predicted]
    for i, points in enumerate(true):
        tree = cKDTree(points)
        for j, other in enumerate(predicted):
            recall = (trees[j].query(points, distance_upper_bound=near_px)[0] <= near_px).mean()
            precision = (tree.query(other, distance_upper_bound=near_px)[0] <= near_px).mean()
            out[i, j] = 2 * precision * recall / max(precision + recall, 1e-9)
    return out


def dense(line: np.ndarray, seen: np.ndarray | None = None, spacing_px: float = 3.0) -> np.ndarray:
    """Points (n, 2) about every ``spacing_px`` along the segments of ``line`` both of whose ends
    are ``seen``."""
    keep = np.ones(len(line) - 1, bool) if seen is None else seen[:-1] & seen[1:]
    starts, steps = line[:-1][keep], np.diff(line, axis=0)[keep]
    count = max(int(np.ceil(np.hypot(*steps.T).mean() / spacing_px)), 1) if len(steps) else 1
    share = (np.arange(count) / count)[:, None, None]
    return np.asarray((starts + share * steps).reshape(-1, 2))
