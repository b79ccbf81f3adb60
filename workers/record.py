"""How a job is kept in the queue server, and the way back to a contract; names of keys are in
workers.keys.

The record is the one truth about a job; RQ only carries its id. Times are seconds since the epoch
on the queue server's clock, so that machines need not agree on theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dlo_client.contracts import (
    AnyJob,
    AnyRequest,
    Contract,
    ImageRef,
    JobEvent,
    JobState,
    UploadRef,
)
from dlo_client.contracts.submission import Queue
from pydantic import TypeAdapter
from pydantic_core import from_json

Priority = Queue
"""Of a job: the queue that it waits in."""
QUEUES: tuple[Priority, ...] = ("interactive", "batch")
"""In the order in which workers look at them."""

TRAINING: Literal["training"] = "training"
"""The queue of what takes minutes; only workers that are started for it look at it."""
ALL_QUEUES: tuple[Priority, ...] = (*QUEUES, TRAINING)

REQUEST: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)

_JOB: TypeAdapter[AnyJob] = TypeAdapter(AnyJob)
_TEXT = ("id", "kind", "priority", "label", "created_at", "started_at", "ended_at", "expires_at")
_JSON = ("progress", "attempts", "timings_ms", "result", "problem", "files", "poses", "recipe")
LISTED = (*_TEXT, "state", *(name for name in _JSON if name not in ("result", "poses")))
"""What a list of jobs shows: everything but the result and its poses, which can be large."""


@dataclass(frozen=True)
class Entry:
    """What the queue has to know of a request, so that it need not read it again."""

    kind: str
    priority: Priority
    label: str | None
    timeout_s: float
    webhook_url: str | None
    request: str
    """Its JSON."""
    pictures: tuple[str, ...]
    """Blob ids of the pictures and other uploads that it names."""
    recipe: str = ""
    """JSON of the recipe that it was made by, if any."""

    @classmethod
    def of(cls, request: AnyRequest) -> Entry:
        return cls(
            kind=request.kind,
            priority=request.queue,
            label=request.label,
            timeout_s=request.timeout_s,
            webhook_url=request.webhook_url,
            request=request.model_dump_json(),
            pictures=tuple(pictures(request)),
        )


@dataclass(frozen=True)
class Origin:
    """Where a job came from: the owner of the API key, and what ties it to its HTTP request in logs
    and traces."""

    owner: str = ""
    request_id: str = ""
    traceparent: str = ""
    """As W3C Trace Context has it."""


@dataclass(frozen=True)
class JobRecord:
    """A job as it is answered: its result stays text, which can be megabytes and is valid as it
    stands."""

    job: AnyJob
    """Without its result."""
    result: str | None
    owner: str

    @classmethod
    def read(cls, record: Mapping[str, str]) -> JobRecord:
        return cls(
            read_job({**record, "result": ""}),
            record.get("result") or None,
            record.get("owner", ""),
        )

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
    return JobEvent(
        id=event_id, state=JobState(fields["state"]), progress=float(fields["progress"])
    )


def pictures(value: object) -> list[str]:
    """Blob ids of all pictures and other uploads that a request names, however deep."""
    match value:
        case ImageRef() | UploadRef():
            return [value.id]
        case Contract():
            return [
                blob for name in type(value).model_fields for blob in pictures(getattr(value, name))
            ]
        case list() | tuple():
            return [blob for item in value for blob in pictures(item)]
        case _:
            return []
