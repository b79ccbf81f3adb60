"""Has a calibration drifted? From the reprojection errors of ordinary ``reconstruct`` jobs, without
a board.

A camera that was bumped, or a flange pose that is no longer right, makes pictures from different
poses disagree: the mean reprojection error of every job rises above what it was when the
calibration was new.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dlo_client.contracts import ReconstructResult

_LEAST_JOBS = 5
_LOUD = 4.0
"""Scaled deviations (median absolute) above the first jobs' median, beyond which a change is no
chance."""
_LEAST_RISE = 1.5
"""And as a factor: a change that is certain but small harms nobody."""


@dataclass(frozen=True)
class Drift:
    """``before_px`` and ``now_px``: medians of the jobs' reprojection errors; ``drifted``:
    calibrate again."""

    before_px: float
    now_px: float
    drifted: bool


def drift_of(before: Iterable[ReconstructResult], now: Iterable[ReconstructResult]) -> Drift:
    """Compare jobs made soon after a calibration with recent ones; five of each or more. Raises
    ValueError."""
    old, new = ([result.reprojection_px for result in results] for results in (before, now))
    if min(len(old), len(new)) < _LEAST_JOBS:
        raise ValueError(
            f"{_LEAST_JOBS} jobs before and {_LEAST_JOBS} now are needed, not {len(old)} and {len(new)}"
        )
    median, recent = float(np.median(old)), float(np.median(new))
    spread = 1.4826 * float(np.median(np.abs(np.array(old) - median)))
    margin = _LOUD * max(spread, 0.05 * median) * np.sqrt(1 / len(old) + 1 / len(new))
    return Drift(median, recent, bool(recent > median + margin and recent > _LEAST_RISE * median))
