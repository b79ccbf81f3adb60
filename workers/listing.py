"""Recent jobs, newest first, page by page."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import redis
from dlo_client.contracts import AnyJob, JobKind, JobPage, JobState

from workers.keys import Keys
from workers.record import LISTED, read_job

_BATCH = 100
_MAX_BATCHES = 10
"""A page is cut short rather than looking at more than this many batches for a rare state or
kind."""


def recent_page(
    client: redis.Redis,
    keys: Keys,
    *,
    limit: int,
    cursor: str | None,
    state: JobState | None,
    kind: JobKind | None,
    owner: str | None = None,
) -> JobPage:
    """At most ``limit`` jobs older than ``cursor``, of ``owner`` if one is named, without results.

    Raises ValueError on a foreign cursor. A page may hold fewer jobs and still name a
    ``next_cursor``: only a page without one is the last.
    """
    if cursor is not None and not (cursor.isascii() and cursor.isdecimal()):
        raise ValueError(f"not a cursor: {cursor!r}")
    below = f"({cursor}" if cursor is not None else "+inf"
    found: list[AnyJob] = []
    for _ in range(_MAX_BATCHES):
        answer = client.zrevrangebyscore(
            keys.recent, below, "-inf", start=0, num=_BATCH, withscores=True
        )
        batch = cast(list[tuple[str, float]], answer)
        for (_, number), job in zip(
            batch, _jobs(client, keys, [job_id for job_id, _ in batch], owner), strict=True
        ):
            below = f"({int(number)}"
            if job and state in (None, job.state) and kind in (None, job.kind):
                found.append(job)
                if len(found) == limit:
                    return JobPage(jobs=found, next_cursor=below[1:])
        if len(batch) < _BATCH:
            return JobPage(jobs=found)
    return JobPage(jobs=found, next_cursor=below[1:])


def trim(client: redis.Redis, keys: Keys) -> int:
    """Forget the oldest jobs whose records have expired; return how many."""
    trimmed = 0
    for _ in range(_MAX_BATCHES):
        oldest = cast(list[str], client.zrange(keys.recent, 0, _BATCH - 1))
        gone = [
            job_id
            for job_id, there in zip(oldest, _exist(client, keys, oldest), strict=True)
            if not there
        ]
        if gone:
            trimmed += client.zrem(keys.recent, *gone)
        if len(gone) < _BATCH:
            break
    return trimmed


def _jobs(
    client: redis.Redis, keys: Keys, job_ids: Iterable[str], owner: str | None
) -> list[AnyJob | None]:
    """The jobs without their results; None where the record has expired, or is not ``owner``'s if
    one is named."""
    with client.pipeline(transaction=False) as pipeline:
        for job_id in job_ids:
            pipeline.hmget(keys.job(job_id), (*LISTED, "owner"))
        rows = pipeline.execute()
    names = (*LISTED, "owner")
    records = [
        {name: value for name, value in zip(names, row, strict=True) if value} for row in rows
    ]
    return [
        read_job(record) if record and owner in (None, record.get("owner", "")) else None
        for record in records
    ]


def _exist(client: redis.Redis, keys: Keys, job_ids: Iterable[str]) -> list[int]:
    with client.pipeline(transaction=False) as pipeline:
        for job_id in job_ids:
            pipeline.exists(keys.job(job_id))
        return pipeline.execute()
