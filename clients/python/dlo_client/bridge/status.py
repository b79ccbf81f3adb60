"""The status numbers of the bridge; they stay the same."""

from __future__ import annotations

from enum import IntEnum

from dlo_client.contracts import AnyJob
from dlo_client.errors import (
    APIError,
    ConnectionFailed,
    InvalidArgument,
    InvalidRequest,
    JobCancelled,
    JobFailed,
    NotFound,
    QueueFull,
    ServiceFault,
    Unauthorized,
    WaitTimeout,
)


class Status(IntEnum):
    """0 to 9 all is well, 10 to 19 the answer needs a look, from 20 on something failed."""

    OK = 0
    ACCEPTED = 1
    RUNNING = 2
    NOTHING_FOUND = 10
    UNSURE = 11
    NO_ACTION = 12
    UNKNOWN_COMMAND = 20
    BAD_ARGUMENT = 21
    UNKNOWN_RECIPE = 22
    UNKNOWN_SEQUENCE = 23
    SEQUENCE_IN_USE = 24
    NO_SUCH_POSE = 25
    TOO_MANY_JOBS = 26
    NO_PICTURE = 30
    REFUSED = 31
    JOB_FAILED = 40
    CANCELLED = 41
    TIMED_OUT = 42
    SERVICE_AWAY = 50
    SERVICE_BUSY = 51
    NOT_AUTHORIZED = 52
    INTERNAL = 90


_UNSURE = ("unsure",)
_NOTHING = ("none_found", "empty", "no_crossing")
_NO_ACTION = ("no_action", "target_outside", "stuck")
_BY_ERROR: tuple[tuple[type[Exception], Status], ...] = (
    (JobCancelled, Status.CANCELLED),
    (JobFailed, Status.JOB_FAILED),
    (WaitTimeout, Status.TIMED_OUT),
    (ConnectionFailed, Status.SERVICE_AWAY),
    (NotFound, Status.UNKNOWN_RECIPE),
    (QueueFull, Status.SERVICE_BUSY),
    (ServiceFault, Status.SERVICE_BUSY),
    (Unauthorized, Status.NOT_AUTHORIZED),
    (InvalidRequest, Status.REFUSED),
    (APIError, Status.REFUSED),
    (InvalidArgument, Status.BAD_ARGUMENT),
)


def of_job(job: AnyJob) -> Status:
    """Of a job that succeeded: what its result states of itself."""
    stated = getattr(job.result, "status", None)
    code = str(getattr(stated, "code", stated))
    if code in _UNSURE:
        return Status.UNSURE
    if code in _NOTHING:
        return Status.NOTHING_FOUND
    return Status.NO_ACTION if code in _NO_ACTION else Status.OK


def of_error(error: Exception) -> Status:
    """Of what the client raised; what is not known is ours."""
    return next((status for kind, status in _BY_ERROR if isinstance(error, kind)), Status.INTERNAL)
