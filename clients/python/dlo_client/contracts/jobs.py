"""A job as a client sees it, and the one form every error has."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Generic

from pydantic import Field

from dlo_client.contracts.base import Probability, Reply, ResultT
from dlo_client.contracts.frames import RobotPoses
from dlo_client.contracts.images import BlobId
from dlo_client.contracts.recipes import RecipeUsed
from dlo_client.contracts.requests import AnyResult, JobKind
from dlo_client.contracts.submission import Queue


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

    field: str = Field(description="path of the field, as `params.neighbors`")
    message: str = Field(description="what is wrong with it")


class Problem(Reply):
    """RFC 9457 problem details, the body of every error (``application/problem+json``).

    ``code`` is stable and for programs: ``invalid_*`` is the request's fault, ``internal`` ours
    (then ``incident`` is also in the log).
    """

    type: str = Field(
        default="about:blank", description="`about:blank`: `code` tells problems apart"
    )
    title: str = Field(description="the status in words")
    status: int = Field(ge=400, le=599, description="as the HTTP status")
    detail: str = Field(description="what went wrong, for people")
    code: str = Field(description="what went wrong, for programs; it stays the same")
    errors: list[FieldProblem] = Field(default_factory=list, description="fields at fault")
    incident: str | None = Field(
        default=None, description="also in the service's log, for a fault of ours"
    )


class FileRef(Reply):
    """A file of a result, at ``/v1/jobs/{id}/files/{name}``."""

    name: str = Field(description="as in `/v1/jobs/{id}/files/{name}`")
    media_type: str = Field(description="such as `image/png`")
    bytes: int = Field(description="its size, bytes")
    sha256: BlobId


class Job(Reply, Generic[ResultT]):
    """A job and, once it has ended, its ``result`` or its ``problem``."""

    id: str = Field(description="32 hexadecimal digits")
    kind: JobKind = Field(description="of its request")
    state: JobState = Field(
        description="`queued`, `running`, or how it ended: `succeeded`, `failed`, `cancelled`"
    )
    progress: Probability = Field(description="share of the work that is done")
    priority: Queue = Field(
        description="queue: `interactive` goes before `batch`; `training` has its own workers"
    )
    label: str | None = Field(default=None, description="as in the request")
    attempts: int = Field(default=0, description="times a worker has taken it up")
    created_at: datetime = Field(description="accepted by the service")
    started_at: datetime | None = Field(
        default=None, description="taken up by a worker, the last time"
    )
    ended_at: datetime | None = Field(default=None, description="succeeded, failed or cancelled")
    expires_at: datetime | None = Field(default=None, description="then it answers 410")
    timings_ms: dict[str, float] = Field(
        default_factory=dict, description="milliseconds by step; `a.b` is part of `a`"
    )
    result: ResultT | None = Field(
        default=None, description="of a job that succeeded, by its `kind`"
    )
    problem: Problem | None = Field(default=None, description="of a job that failed")
    files: list[FileRef] = Field(
        default_factory=list, description="pictures and tables of the result"
    )
    poses: RobotPoses | None = Field(
        default=None, description="its places, when the request has an `output`"
    )
    recipe: RecipeUsed | None = Field(default=None, description="that the job was made by, if any")


AnyJob = Job[AnyResult]


class JobPage(Reply):
    """A page of jobs, newest first; ``next_cursor`` is None on the last."""

    jobs: list[AnyJob] = Field(description="newest first, without their results")
    next_cursor: str | None = Field(
        default=None, description="`cursor` of the next page; null on the last"
    )


class JobEvent(Reply):
    """One server-sent event of a job."""

    id: str = Field(description="for `Last-Event-ID`, to resume after it")
    state: JobState = Field(description="of the job, from this event on")
    progress: Probability = Field(description="share of the work that is done")
