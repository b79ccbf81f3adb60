"""Waiting for a job to end, on the event loop: a waiter holds a connection to the queue, not a
thread."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator

from dlo_client.contracts import AnyJob, JobEvent

from workers.queue import AsyncJobQueue
from workers.record import JobRecord

_BLOCK_S = 5.0
"""Longest single wait for the next event."""


async def ended(queue: AsyncJobQueue, job_id: str, wait_s: float) -> JobRecord:
    """The job as soon as it has ended, or as it stands after ``wait_s`` seconds."""
    deadline = time.monotonic() + wait_s
    while True:
        left_s = deadline - time.monotonic()
        if left_s <= 0:
            return await queue.get(job_id)
        record = await queue.when_ended(job_id, _milliseconds(min(left_s, _BLOCK_S)))
        if record.job.state.final:
            return record


async def follow(queue: AsyncJobQueue, job: AnyJob, after: str) -> AsyncIterator[JobEvent]:
    """The job's events after the event ``after``, up to the one that ends it."""
    while True:
        block_ms = 0 if job.state.final else _milliseconds(_BLOCK_S)
        events = await queue.events(job.id, after, block_ms)
        for event in events:
            yield event
            after = event.id
        if job.state.final or (events and events[-1].state.final):
            return
        if not events:
            job = (await queue.get(job.id)).job


def _milliseconds(seconds: float) -> int:
    return max(1, round(seconds * 1000))
