"""Waiting for a job to end, on the event loop: a waiter holds a connection to the queue, not a thread."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator

from dlo_client.contracts import AnyJob, JobEvent

from workers.queue import AsyncJobQueue
from workers.record import JobRecord

_BLOCK_S = 5.0
"""Longest single wait for the next event."""


async def ended(queue: AsyncJobQueue, record: JobRecord, wait_s: float) -> JobRecord:
    """The job as soon as it has ended, or as it stands after ``wait_s`` seconds."""
    if record.job.state.final or wait_s <= 0:
        return record
    job_id = record.job.id
    deadline = time.monotonic() + wait_s
    after = "0"
    while (left_s := deadline - time.monotonic()) > 0:
        events = await queue.events(job_id, after, _milliseconds(min(left_s, _BLOCK_S)))
        if events and events[-1].state.final:
            break
        after = events[-1].id if events else after
    return await queue.get(job_id)


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
