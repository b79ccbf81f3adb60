"""Why a job failed, as a client is told; codes are stable."""

from __future__ import annotations

from dlo_client.contracts import FieldProblem, Problem


def invalid(field: str, message: str, code: str) -> Problem:
    """The request's fault, at ``field``."""
    return Problem(
        title="The input cannot be used",
        status=422,
        detail=f"{field}: {message}",
        code=code,
        errors=[FieldProblem(field=field, message=message)],
    )


def internal(incident: str) -> Problem:
    """Our fault; ``incident`` is in the log."""
    return Problem(
        title="Internal error",
        status=500,
        detail="The job failed through no fault of the request. The incident is in the log.",
        code="internal",
        incident=incident,
    )


def deadline_exceeded() -> Problem:
    return Problem(
        title="Too late to start",
        status=504,
        detail="The job waited longer than its timeout_s and was dropped before it started.",
        code="deadline_exceeded",
    )


def timed_out() -> Problem:
    return Problem(
        title="Time limit reached",
        status=504,
        detail="The job did not end within its timeout_s and was stopped.",
        code="timed_out",
    )


def worker_lost() -> Problem:
    return Problem(
        title="Worker lost",
        status=503,
        detail="The worker died while it ran this job, and no attempt is left.",
        code="worker_lost",
    )


def refused() -> Problem:
    return Problem(
        title="Refused",
        status=500,
        detail="The queue entry of this job calls something that workers do not run.",
        code="refused",
    )


def too_large() -> Problem:
    return Problem(
        title="Too large",
        status=413,
        detail="The job needs more memory than a job may take (DLO_CHILD_MEMORY_MB). Send less, or smaller pictures.",
        code="too_large",
    )


def storage_full() -> Problem:
    return Problem(
        title="No room on the disk",
        status=507,
        detail="The files of the result could not be written down: the disk of the service is too full.",
        code="storage_full",
    )


def storage_unavailable() -> Problem:
    return Problem(
        title="Pictures cannot be reached",
        status=503,
        detail="The place that holds pictures and results does not answer. Send the request again later.",
        code="storage_unavailable",
    )
