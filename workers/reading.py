"""How the queue server is asked about one job, and how its answers are read; for callers that block
and others."""

from __future__ import annotations

import re
from typing import Any

from dlo_client.contracts import JobEvent

from workers.connection import LONGEST_BLOCK_MS
from workers.errors import JobGone, JobUnknown, QueueError
from workers.keys import Keys
from workers.record import read_event

_EVENT_ID = re.compile(r"\d{1,20}(-\d{1,20})?")


def absent(tombstone: int, job_id: str) -> QueueError:
    """The error about a job without a record."""
    return JobGone(job_id) if tombstone else JobUnknown(job_id)


def stream_after(keys: Keys, job_id: str, after: str) -> tuple[Any]:
    """Arguments of ``xread``."""
    return ({keys.events(job_id): after if _EVENT_ID.fullmatch(after) else "0"},)


def bounded_block(block_ms: int) -> int | None:
    """The server takes 0 for ever."""
    return max(0, min(block_ms, LONGEST_BLOCK_MS)) or None


def events_of(answer: Any) -> list[JobEvent]:
    """One stream was read: redis-py answers a dict (RESP3) or a list of pairs (RESP2)."""
    streams = answer.values() if isinstance(answer, dict) else [entries for _, entries in answer]
    return [read_event(event_id, fields) for entries in streams for event_id, fields in entries]
