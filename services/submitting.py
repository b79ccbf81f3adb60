"""A read submission into the queue, and the answer: shared by the routes that make jobs."""

from __future__ import annotations

import hashlib
from functools import partial
from typing import Annotated, Any

from anyio import to_thread
from fastapi import Header, Query, Request, Response

from services import waiting
from services.access import Backend, Caller
from services.problems import ProblemError
from services.submissions import Submission
from services.telemetry import origin
from workers.record import TRAINING, JobRecord

JOBS = "/v1/jobs"
"""Where jobs are."""

_SHORT_BODY = 256 * 1024
"""Such a body is read in the time that it takes to ask whether there is room for its job."""

Wait = Annotated[
    float, Query(ge=0, le=60, allow_inf_nan=False, description="seconds to wait for the job to end")
]
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=255,
        description="the same key and request give the same job for 24 h; another request is refused",
    ),
]


async def check_room(request: Request, caller: Caller, backend: Backend, key: str | None) -> None:
    """Raise QueueFull before a long body is read for nothing; with a short one it is found out when
    it is submitted."""
    length = request.headers.get("content-length", "")
    if length.isdecimal() and int(length) <= _SHORT_BODY:
        return
    await to_thread.run_sync(backend.queue.check_room, key, caller.owner, caller.most_jobs)


async def submitted(
    submission: Submission, caller: Caller, backend: Backend, key: str | None
) -> str:
    """Put it into the queue, and its pictures into the blobs once there is room; the job's id. What
    only few workers do is not left to wait when none of them is there."""
    if submission.entry.priority == TRAINING and not await to_thread.run_sync(backend.queue.trains):
        detail = "no worker trains here; an operator starts one with `python -m workers --queues training`"
        raise ProblemError(503, "no_training_worker", detail, headers={"Retry-After": "60"})

    def keep() -> None:
        backend.queue.charge(caller.owner, caller.most_bytes, submission.sizes())
        submission.keep()

    terms: dict[str, Any] = {
        "idempotency_key": key,
        "request_digest": hashlib.sha256(submission.entry.request.encode()).hexdigest(),
        "origin": origin(caller.owner),
        "most_jobs": caller.most_jobs,
    }
    if not submission.staged and (opening := backend.queue.opening(submission.entry, **terms)):
        return await backend.waiting.open(opening)
    put = partial(
        backend.queue.put, submission.entry, keep=keep if submission.staged else None, **terms
    )
    job_id, _ = await to_thread.run_sync(put)
    return job_id


async def awaited(backend: Backend, job_id: str, wait: float) -> Response:
    """200 and the ended job if it ends within ``wait`` seconds, else 202; and where it is."""
    record = await waiting.ended(backend.waiting, job_id, wait)
    status = 200 if wait and record.job.state.final else 202
    return answer(record, status, Location=f"{JOBS}/{job_id}")


def answer(record: JobRecord, status: int = 200, **headers: str) -> Response:
    """The record's own text: a result can be megabytes, and reading it here would hold up everybody
    else."""
    return Response(record.json(), status, headers, media_type="application/json")
