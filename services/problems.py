"""Every error of the service is an RFC 9457 problem; :func:`problem_of` is the one table of
them."""

from __future__ import annotations

import errno
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus

import structlog
from dlo_client.contracts import FieldProblem, Problem
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from redis.exceptions import RedisError
from starlette.exceptions import HTTPException

from services.fields import parameter_problems
from workers.blobs import BlobMissing, BlobsUnreachableError, NoRoomError
from workers.errors import TrackBusy, TracksFull, TrackUnknown
from workers.networks.store import NetworkUnknownError
from workers.queue import IdempotencyConflict, JobGone, JobUnknown, QueueFull
from workers.quota import QuotaExceededError

MEDIA_TYPE = "application/problem+json"
MOST_ERRORS, _FIELD_LENGTH, _MESSAGE_LENGTH = 20, 100, 250
"""So that no answer is larger than 50 kB, whatever was sent and however it is escaped."""

log = structlog.get_logger(__name__)


class ProblemError(Exception):
    """A request that cannot be answered; carries the problem to answer with."""

    def __init__(
        self,
        status: int,
        code: str,
        detail: str,
        *,
        errors: list[FieldProblem] | None = None,
        incident: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.headers = headers
        self.problem = Problem(
            title=HTTPStatus(status).phrase,
            status=status,
            detail=detail,
            code=code,
            errors=errors or [],
            incident=incident,
        )


def field_error(
    field: str, message: str, *, code: str = "invalid_request", status: int = 422
) -> ProblemError:
    """The problem of a request with one field at fault."""
    error = _bounded(FieldProblem(field=field, message=message))
    return ProblemError(status, code, f"{error.field}: {error.message}", errors=[error])


def fields_error(errors: list[FieldProblem], count: int) -> ProblemError:
    """The problem of a request with ``count`` fields at fault, the first in ``errors``, three in
    ``detail`` too."""
    named = [_bounded(error) for error in errors[:MOST_ERRORS]]
    detail = "; ".join(f"{error.field}: {error.message}" for error in named[:3])
    more = f" (and {count - 3} more)" if count > 3 else ""
    return ProblemError(422, "invalid_request", detail + more, errors=named)


def _bounded(error: FieldProblem) -> FieldProblem:
    """Names and messages may quote what the caller sent."""
    return FieldProblem(
        field=_clipped(error.field, _FIELD_LENGTH), message=_clipped(error.message, _MESSAGE_LENGTH)
    )


def _clipped(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[: length - 1]}…"


@dataclass(frozen=True)
class _Answer:
    """The problem that all errors of a type are; ``retry_s``: when to try again; ``log``: what the
    log states of it."""

    status: int
    code: str
    detail: str
    retry_s: float | None = None
    log: str | None = None


_ANSWERS: dict[type[Exception], _Answer] = {
    JobUnknown: _Answer(404, "unknown_job", "no job has this id"),
    JobGone: _Answer(410, "job_expired", "the job has ended and its result is no longer kept"),
    NetworkUnknownError: _Answer(
        404, "unknown_network", "no network that was adapted or brought here has this name"
    ),
    TrackUnknown: _Answer(404, "unknown_track", "no track has this id (any longer)"),
    TrackBusy: _Answer(
        409,
        "track_busy",
        "another frame of this track is being looked at; send one after the other",
        retry_s=1.0,
    ),
    BlobMissing: _Answer(410, "file_expired", "the file is no longer kept"),
    NoRoomError: _Answer(
        507,
        "storage_full",
        "the disk of the service is too full for this; try again later",
        retry_s=60.0,
        log="no room on the disk",
    ),
    BlobsUnreachableError: _Answer(
        503,
        "storage_unavailable",
        "the store of pictures cannot be reached; try again later",
        retry_s=2.0,
        log="pictures not reachable",
    ),
    QuotaExceededError: _Answer(
        507,
        "quota_exceeded",
        "this API key keeps as many bytes as it may; try again later",
        retry_s=3600.0,
    ),
    RedisError: _Answer(
        503,
        "queue_unavailable",
        "the queue cannot be reached; try again later",
        retry_s=1.0,
        log="queue not reachable",
    ),
}


def problem_of(error: Exception) -> ProblemError:
    """Sort ``error`` by whose fault it is. What is not known is ours, and in the log with its
    incident id."""
    known = next((_ANSWERS[kind] for kind in type(error).__mro__ if kind in _ANSWERS), None)
    if known is not None:
        if known.log is not None:
            log.warning(known.log, error=str(error))
        if known.retry_s is not None:
            return _retry(known.status, known.code, known.detail, known.retry_s)
        return ProblemError(known.status, known.code, known.detail)
    match error:
        case ProblemError():
            return error
        case RequestValidationError():
            problems = parameter_problems(error.errors())
            return fields_error(problems, len(problems))
        case HTTPException():
            code = HTTPStatus(error.status_code).name.lower()
            return ProblemError(error.status_code, code, str(error.detail), headers=error.headers)
        case TracksFull():
            detail = f"{error}; end those that are over"
            return _retry(429, "too_many_tracks", detail, error.retry_after_s)
        case IdempotencyConflict():
            message = "this Idempotency-Key was used before, for another request"
            return field_error("Idempotency-Key", message, code="idempotency_conflict", status=409)
        case OSError() if error.errno in (errno.EMFILE, errno.ENFILE):
            log.warning("out of file descriptors")
            detail = "the service does too much at once; try again later"
            return _retry(503, "overloaded", detail, 2.0)
        case QueueFull():
            return _retry(429, "queue_full", f"{error}; try again later", error.retry_after_s)
        case _:
            return _internal(error)


def _retry(status: int, code: str, detail: str, after_s: float) -> ProblemError:
    return ProblemError(status, code, detail, headers={"Retry-After": str(max(1, round(after_s)))})


def _internal(error: Exception) -> ProblemError:
    incident = uuid.uuid4().hex
    log.error("incident", incident=incident, exc_info=error)
    return ProblemError(
        500, "internal", "an error of the service, not of the request", incident=incident
    )


def response_of(error: ProblemError) -> Response:
    """``error`` as a response."""
    return Response(
        error.problem.model_dump_json(exclude_none=True),
        status_code=error.problem.status,
        media_type=MEDIA_TYPE,
        headers=error.headers,
    )


async def _answer(_: Request, error: Exception) -> Response:
    return response_of(problem_of(error))


def install(app: FastAPI) -> None:
    """Let ``app`` answer the errors that are known by type; the others reach
    :mod:`services.middleware`."""
    by_value = (IdempotencyConflict, QueueFull, TracksFull)
    known = (ProblemError, RequestValidationError, HTTPException, *by_value, *_ANSWERS)
    for kind in known:
        app.add_exception_handler(kind, _answer)
