"""Identity over a clip: IDF1, switches, and how far a point drifts along its cable."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

NEAR_WIDTHS = 2.0
LEAST_VISIBLE = 0.3
"""A cable of which less is in view need not be found in a frame."""


class Identities:
    """Counts, frame by frame, which predicted id is on which true cable."""

    def __init__(self, width_px: float) -> None:
        self.width_px = width_px
        self.pairs: Counter[tuple[int, int]] = Counter()
        self.true = self.predicted = self.switches = 0
        self._last: dict[int, int] = {}

    def add(self, true: Mapping[int, np.ndarray], predicted: Mapping[int, np.ndarray]) -> dict[int, int]:
        """``true`` and ``predicted`` curves (n, 2) by id; returns predicted by true id in this frame."""
        self.true += len(true)
        self.predicted += len(predicted)
        if not true or not predicted:
            return {}
        keys, others = list(true), list(predicted)
        away = np.array([[_away(true[a], predicted[b]) for b in others] for a in keys]) / self.width_px
        rows, columns = linear_sum_assignment(np.minimum(away, NEAR_WIDTHS))
        found = {keys[i]: others[j] for i, j in zip(rows, columns, strict=True) if away[i, j] < NEAR_WIDTHS}
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


def _away(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance of the points of the shorter curve to the other one."""
    first, second = (a, b) if _length(a) < _length(b) else (b, a)
    return float(cKDTree(_dense(second)).query(_dense(first))[0].mean())


def _dense(line: np.ndarray) -> np.ndarray:
    share = np.linspace(0, len(line) - 1, 200)
    return np.stack([np.interp(share, np.arange(len(line)), axis) for axis in line.T], axis=1)


def _length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())
