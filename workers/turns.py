"""How a worker divides its time between interactive jobs and those of batch."""

from __future__ import annotations

import time

from workers.settings import LONGEST_JOB_S


class Turns:
    """Which queue is looked into first: the interactive one, but for the share of jobs that batch
    is owed."""

    def __init__(self, batch_share: float) -> None:
        self._owed_each = batch_share / (1 - batch_share)
        self._owed = 0.0

    @property
    def batch_first(self) -> bool:
        """Whether the next job should be one of batch, if any waits."""
        return self._owed > 1 - 1e-9

    def taken(self, *, batch: bool) -> None:
        """A job was taken; while no batch job waits the debt does not grow beyond one job."""
        self._owed = 0.0 if batch else min(self._owed + self._owed_each, 1.0)


class Pauses:
    """When a batch job may stand still: it has its share of the time, and never stands still for
    too long."""

    def __init__(self, share: float) -> None:
        self._owed_each = share / (1 - share)
        self._next, self._stood_s = time.monotonic(), 0.0

    @property
    def allowed(self) -> bool:
        """Whether it has run for long enough since it stood still last."""
        return time.monotonic() >= self._next and self._stood_s < LONGEST_JOB_S

    def add(self, seconds: float) -> None:
        """It stood still for so long until now."""
        self._stood_s += seconds
        self._next = time.monotonic() + seconds * self._owed_each
