"""What the queue's door answers instead of a job.

QueueError
├── JobUnknown           no such job
├── JobGone              there was one; its record has expired
├── QueueFull            too much waits; come back after ``retry_after_s``
├── IdempotencyConflict  the key was used for another request
├── TrackUnknown         no such track, or no longer
├── TrackBusy            another frame of it is being looked at
└── TracksFull           there are as many as there may be
"""

from __future__ import annotations


class QueueError(Exception):
    """Base of all."""


class JobUnknown(QueueError):
    pass


class JobGone(QueueError):
    pass


class IdempotencyConflict(QueueError):
    pass


class QueueFull(QueueError):
    def __init__(self, why: str, retry_after_s: float) -> None:
        super().__init__(why)
        self.retry_after_s = retry_after_s


class TrackUnknown(QueueError):
    pass


class TrackBusy(QueueError):
    pass


class TracksFull(QueueError):
    def __init__(self, why: str, retry_after_s: float) -> None:
        super().__init__(why)
        self.retry_after_s = retry_after_s
