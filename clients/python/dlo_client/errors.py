"""What can go wrong, as one tree::

DLOError
├── InvalidArgument       what the caller gave cannot be used, nothing was sent: see ``.argument``
├── ConnectionFailed      nobody answered, or the connection broke, after all attempts
├── UnexpectedReply       somebody answered, but not with an answer of this version of the API
├── APIError              the service refused, and gives the reason in ``.problem``
│   ├── InvalidRequest    400, 413, 415, 422 and other 4xx: ``.problem.errors`` names the fields
│   ├── Unauthorized      401, 403: the API key is missing or wrong
│   ├── NotFound          404
│   ├── Conflict          409: this idempotency key came before with another request
│   ├── Gone              410: it has expired
│   ├── QueueFull         429: try again in ``.retry_after_s``
│   └── ServiceFault      5xx: not the request's fault; ``.problem.incident`` is in the service's log
│       ├── Unavailable   503: its queue is away, or it is overloaded: try again later
│       └── StorageFull   507: its disk is too full, or this key keeps as many bytes as it may
├── JobFailed             the job was accepted and ended badly: the reason is in ``.problem``
├── JobCancelled          the job was cancelled
└── WaitTimeout           the job goes on, only the waiting ended: ``.job`` is its last known state

A request with a wrong field is refused by pydantic when it is made (``pydantic.ValidationError``),
and a picture file that cannot be read is an ``OSError``.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from pydantic import ValidationError

from dlo_client.contracts import Job, Problem


class DLOError(Exception):
    """Base of everything this package raises on purpose."""


class InvalidArgument(DLOError, ValueError):
    """An argument of the SDK that cannot be used, such as an array that is no picture."""

    def __init__(self, argument: str, message: str) -> None:
        super().__init__(f"{argument}: {message}")
        self.argument = argument


class ConnectionFailed(DLOError):
    """Nobody answered, or the connection broke."""


class UnexpectedReply(DLOError):
    """The reply is not what the API states: another server, a proxy's page, or another version."""


class APIError(DLOError):
    """The service refused the call; its log has it under ``request_id``."""

    def __init__(
        self, problem: Problem, retry_after_s: float | None = None, request_id: str | None = None
    ) -> None:
        super().__init__(describe(problem))
        self.problem = problem
        self.retry_after_s = retry_after_s
        self.request_id = request_id


class InvalidRequest(APIError):
    """4xx: the request is at fault."""


class Unauthorized(APIError):
    """401 or 403."""


class NotFound(APIError):
    """404."""


class Conflict(APIError):
    """409."""


class Gone(APIError):
    """410."""


class QueueFull(APIError):
    """429."""


class ServiceFault(APIError):
    """5xx: the service is at fault."""


class Unavailable(ServiceFault):
    """503."""


class StorageFull(ServiceFault):
    """507."""


class JobFailed(DLOError):
    """The job ended in state ``failed``."""

    def __init__(self, job: Job[Any], problem: Problem) -> None:
        super().__init__(f"job {job.id} failed: {describe(problem)}")
        self.job = job
        self.problem = problem


class JobCancelled(DLOError):
    """The job ended in state ``cancelled``."""

    def __init__(self, job: Job[Any]) -> None:
        super().__init__(f"job {job.id} was cancelled")
        self.job = job


class WaitTimeout(DLOError):
    """The job had not ended in time; it goes on."""

    def __init__(self, job: Job[Any], timeout: float) -> None:
        super().__init__(f"job {job.id} is still {job.state} after {timeout:g} s")
        self.job = job


def describe(problem: Problem) -> str:
    """A problem in one line: title, detail, fields at fault that the detail does not name,
    incident."""
    text = f"{problem.title}: {problem.detail}" if problem.detail else problem.title
    unnamed = [error for error in problem.errors if error.message not in problem.detail]
    if unnamed:
        text += f" ({'; '.join(f'{error.field}: {error.message}' for error in unnamed)})"
    if problem.incident:
        text += f" [incident {problem.incident}]"
    return text


def describe_fields(error: ValidationError) -> str:
    """What pydantic found wrong, in one line: ``views.0.intrinsics.fx: Field required; …``."""
    found = error.errors(include_url=False, include_input=False)
    named = [
        (".".join(map(str, each["loc"])), each["msg"].removeprefix("Value error, "))
        for each in found
    ]
    lines = [f"{field}: {message}" if field else message for field, message in named[:_SHOWN]]
    if len(named) > _SHOWN:
        lines.append(f"and {len(named) - _SHOWN} more")
    return "; ".join(lines)


_SHOWN = 5
"""Wrong fields that are listed."""

_BY_STATUS: dict[int, type[APIError]] = {
    HTTPStatus.UNAUTHORIZED: Unauthorized,
    HTTPStatus.FORBIDDEN: Unauthorized,
    HTTPStatus.NOT_FOUND: NotFound,
    HTTPStatus.CONFLICT: Conflict,
    HTTPStatus.GONE: Gone,
    HTTPStatus.TOO_MANY_REQUESTS: QueueFull,
    HTTPStatus.SERVICE_UNAVAILABLE: Unavailable,
    HTTPStatus.INSUFFICIENT_STORAGE: StorageFull,
}


def refusal(problem: Problem, retry_after_s: float | None, request_id: str | None) -> APIError:
    """The error of the tree for a problem, by its status."""
    fallback = InvalidRequest if problem.status < HTTPStatus.INTERNAL_SERVER_ERROR else ServiceFault
    return _BY_STATUS.get(problem.status, fallback)(problem, retry_after_s, request_id)
