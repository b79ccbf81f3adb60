"""Figures of merit for topologies, as the thesis counts them (Table 6.1) and as F1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

FAR = 1e6


@dataclass
class Tally:
    """Points that were found, that were not there, and that were missed."""

    found: int = 0
    false: int = 0
    missed: int = 0

    def add(self, predicted: np.ndarray, true: np.ndarray, reach: float) -> bool:
        """Match ``(p, 2)`` to ``(t, 2)`` within ``reach`` px; returns whether the counts agree."""
        hits = count_matches(predicted, true, reach)
        self.found += hits
        self.false += len(predicted) - hits
        self.missed += len(true) - hits
        return len(predicted) == len(true)

    @property
    def accuracy(self) -> float:
        """Found over found, false and missed together: the ratio of thesis Table 6.1 (93 of 93 + 7
        + 6)."""
        return self.found / max(self.found + self.false + self.missed, 1)

    @property
    def f1(self) -> float:
        return 2 * self.found / max(2 * self.found + self.false + self.missed, 1)


def count_matches(predicted: np.ndarray, true: np.ndarray, reach: float) -> int:
    """Pairs of an optimal one-to-one matching that are no farther apart than ``reach``."""
    if not len(predicted) or not len(true):
        return 0
    away = np.hypot(*np.moveaxis(np.asarray(predicted)[:, None] - np.asarray(true)[None], -1, 0))
    rows, columns = linear_sum_assignment(np.where(away <= reach, away, FAR))
    return int((away[rows, columns] <= reach).sum())


def link_dice(predicted: np.ndarray, true: frozenset[tuple[int, int]]) -> float:
    """Dice of undirected links: ``(L, 2)`` with ``a < b`` against the true pairs."""
    pairs = {(int(a), int(b)) for a, b in predicted}
    return 2 * len(pairs & true) / max(len(pairs) + len(true), 1)


def points_of(items: object) -> np.ndarray:
    """``(n, 2)`` from branch-points or crossings."""
    return np.array([i.xy for i in items]).reshape(-1, 2)
