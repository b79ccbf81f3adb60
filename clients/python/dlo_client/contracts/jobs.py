"""A job as a client sees it, and the one form every error has."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Generic

from pydantic import Field

from dlo_client.contracts.base import Probability, Reply, ResultT
from dlo_client.contracts.images import BlobId
from dlo_client.contracts.requests import AnyResult, JobKind
from dlo_client.contracts.submission import Priority


class JobState(StrEnum):
    """``queued → running → succeeded | failed | cancelled``; the last three are final."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def final(self) -> bool:
        return self in (JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED)


class FieldProblem(Reply):
    """One field of a request and what is wrong with it; ``field`` as in ``params.neighbors``."""

    field: str
    message: str


class Problem(Reply):
    """RFC 9457 problem details, the body of every error (``application/problem+json``).

    ``code`` is stable and for programs: ``invalid_*`` is the request's fault, ``internal`` ours (then
    ``incident`` is also in the log).
    """

    type: str = "about:blank"
    title: str
    status: int = Field(ge=400, le=599)
    detail: str
    code: str
    errors: list[FieldProblem] = Field(default_factory=list)
    incident: str | None = None


class FileRef(Reply):
    """A file of a result, at ``/v1/jobs/{id}/files/{name}``."""

    name: str
    media_type: str
    bytes: int
    sha256: BlobId


class Job(Reply, Generic[ResultT]):
    """A job and, once it has ended, its ``result`` or its ``problem``."""

    id: str
    kind: JobKind
    state: JobState
    progress: Probability
    priority: Priority
    label: str | None = None
    attempts: int = Field(default=0, description="times a worker has taken it up")
    created_at: datetime
    started_at: datetime | None = None
    ended_at: datetime | None = None
    expires_at: datetime | None = Field(default=None, description="then it answers 410")
    timings_ms: dict[str, float] = Field(default_factory=dict)
    result: ResultT | None = None
    problem: Problem | None = None
    files: list[FileRef] = Field(default_factory=list)


AnyJob = Job[AnyResult]


class JobPage(Reply):
    """A page of jobs, newest first; ``next_cursor`` is None on the last."""

    jobs: list[AnyJob]
    next_cursor: str | None = None


class JobEvent(Reply):
    """One server-sent event of a job."""

    id: str
    state: JobState
    progress: Probability


class NetworkInfo(Reply):
    """A network of the manifest, as ``GET /v1/models`` shows it."""

    name: str
    version: str
    task: str
    default: bool
    sha256: str
    bytes: int
    parameters: int
    input: str = Field(description="layout, size and normalization in words")
    origin: str
    license: str
    metrics: dict[str, float] = Field(default_factory=dict)
