"""How a job lies in the queue server: key names, and the way back to a contract.

The record is the one truth about a job; RQ only carries its id. Times are seconds since the epoch on the
queue server's clock, so that machines need not agree on theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dlo_client.contracts import AnyJob, AnyRequest, Contract, ImageRef, JobEvent, JobState
from pydantic import TypeAdapter
from pydantic_core import from_json

QUEUES: tuple[Literal["interactive"], Literal["batch"]] = ("interactive", "batch")
"""In the order in which workers look at them."""

ACTIVE = "dlo:active"
"""Set of the ids of all jobs that are queued or running."""

RECENT = "dlo:recent"
"""Sorted set of job ids by their running number."""

WEBHOOKS = "dlo:webhooks"
"""Sorted set of the ids of ended jobs whose webhook has not been heard, by the time of the next attempt."""

COUNTS = "dlo:counts"
"""Hash of ``kind|state`` to how many jobs have ever entered that state."""

WORKERS = "dlo:workers"
"""Set of the names of workers that have announced themselves."""

BLOBS = "dlo:blobs"
"""Mark of the folder that holds the pictures, see workers.shared_folder."""

OUTSIDER = "dlo:outsider"
"""Why a worker that is there does not join; expires unless it is said again."""

REQUEST: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)

_JOB: TypeAdapter[AnyJob] = TypeAdapter(AnyJob)
_TEXT = ("id", "kind", "priority", "label", "created_at", "started_at", "ended_at", "expires_at")
_JSON = ("progress", "attempts", "timings_ms", "result", "problem", "files")
LISTED = (*_TEXT, "state", *(name for name in _JSON if name != "result"))
"""What a list of jobs shows: everything but the result, which can be large."""


@dataclass(frozen=True)
class Entry:
    """What the queue has to know of a request, so that it need not read it again."""

    kind: str
    priority: Literal["interactive", "batch"]
    label: str | None
    timeout_s: float
    webhook_url: str | None
    request: str
    """Its JSON."""
    pictures: tuple[str, ...]
    """Blob ids of the pictures that it names."""

    @classmethod
    def of(cls, request: AnyRequest) -> Entry:
        return cls(
            kind=request.kind,
            priority=request.priority,
            label=request.label,
            timeout_s=request.timeout_s,
            webhook_url=request.webhook_url,
            request=request.model_dump_json(),
            pictures=tuple(pictures(request)),
        )


def job_key(job_id: str) -> str:
    return f"dlo:job:{job_id}"


def events_key(job_id: str) -> str:
    return f"dlo:events:{job_id}"


def tombstone_key(job_id: str) -> str:
    return f"dlo:tombstone:{job_id}"


def alive_key(job_id: str) -> str:
    return f"dlo:alive:{job_id}"


def owned_key(owner: str) -> str:
    """Of the set of the ids of an owner's jobs that are queued or running."""
    return f"dlo:owned:{owner}"


def worker_key(name: str) -> str:
    return f"dlo:worker:{name}"


@dataclass(frozen=True)
class JobRecord:
    """A job as it is answered: its result stays text, which can be megabytes and is valid as it stands."""

    job: AnyJob
    """Without its result."""
    result: str | None
    owner: str

    @classmethod
    def read(cls, record: Mapping[str, str]) -> JobRecord:
        return cls(read_job({**record, "result": ""}), record.get("result") or None, record.get("owner", ""))

    def json(self) -> str:
        """What ``model_dump_json`` of the whole job gives."""
        text = self.job.model_dump_json()
        # Once there: inside a text of the job these quotation marks would be escaped.
        return text.replace('"result":null', f'"result":{self.result}', 1) if self.result else text


def read_job(record: Mapping[str, str]) -> AnyJob:
    """The contract of a record, as ``HGETALL`` gives it."""
    fields: dict[str, Any] = {"state": JobState(record["state"])}
    for name in _TEXT:
        if value := record.get(name):
            fields[name] = value
    for name in _JSON:
        if value := record.get(name):
            fields[name] = from_json(value)
    return _JOB.validate_python(fields)


def read_event(event_id: str, fields: Mapping[str, str]) -> JobEvent:
    """The contract of one entry of a job's event stream."""
    return JobEvent(id=event_id, state=JobState(fields["state"]), progress=float(fields["progress"]))


def pictures(value: object) -> list[str]:
    """Blob ids of all pictures that a request names, however deep."""
    match value:
        case ImageRef():
            return [value.id]
        case Contract():
            return [blob for name in type(value).model_fields for blob in pictures(getattr(value, name))]
        case list() | tuple():
            return [blob for item in value for blob in pictures(item)]
        case _:
            return []
