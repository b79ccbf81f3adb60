"""The one function that the queue may call, run in the warm child: do the job, store, sort
errors."""

from __future__ import annotations

import time
from collections.abc import Callable
from uuid import uuid4

import structlog
from dlo_client.contracts import FileRef
from opentelemetry.trace import Span

from workers import memory, problems, stages, tracing
from workers.blobs import BlobMissing, Blobs, BlobsUnreachableError, NoRoomError
from workers.ledger import Claim, Ledger
from workers.record import REQUEST
from workers.robot_poses import robot_poses
from workers.stages.outcome import InvalidInput, Outcome, Tools

_PROGRESS_STEP = 0.01
_TOLD_EVERY_S = 0.2
"""Progress of a job that ends sooner is nothing that anybody could see, but a trip to the queue
server each time."""

log = structlog.get_logger(__name__)


def run(claim: Claim, ledger: Ledger, tools: Tools) -> None:
    """Run the claimed job to its end, good or bad; raises only if the end cannot be written
    down."""
    with tracing.of_job(claim) as span:
        _run(claim, ledger, tools, span)


def _run(claim: Claim, ledger: Ledger, tools: Tools, span: Span) -> None:
    say = log.bind(job_id=claim.job_id, attempt=claim.attempt, request_id=claim.request_id)
    started = time.perf_counter()
    try:
        text = tools.blobs.get(claim.request_blob) if claim.request_blob else claim.request
        request = REQUEST.validate_json(text)
        say = say.bind(kind=request.kind)
        span.update_name(f"job {request.kind}")
        tools.progress = _reporter(claim, ledger)
        tools.owner = claim.owner
        outcome = stages.run(request, tools)
        in_camera = getattr(request, "T_world_camera", None) is None
        poses = (
            robot_poses(request.output, outcome.result, in_camera=in_camera)
            if request.output
            else None
        )
        files = _store(outcome, tools.blobs)
        took_ms = (time.perf_counter() - started) * 1000
        waited_ms = claim.queue_wait_ms
        timings_ms = outcome.timings_ms | {"queue_wait": waited_ms, "total": waited_ms + took_ms}
        timings_ms = {step: round(ms, 3) for step, ms in timings_ms.items()}
        held = ledger.succeed(claim, outcome.result, files, timings_ms, poses)
        say.info("job succeeded", timings_ms=timings_ms, held=held)
    except InvalidInput as error:
        held = ledger.fail(claim, problems.invalid(error.field, error.message, error.code))
        say.info("job failed: invalid input", field=error.field, code=error.code, held=held)
    except (
        BlobsUnreachableError,
        BlobMissing,
    ) as error:  # what the request names is looked for by the stages
        held = ledger.fail(claim, problems.storage_unavailable())
        say.error("job failed: blobs cannot be reached", error=str(error), held=held)
    except NoRoomError as error:
        held = ledger.fail(claim, problems.storage_full())
        say.error("job failed: no room", error=str(error), held=held)
    except Exception as error:
        if memory.ran_out(error):
            with memory.room_to_report(error):
                held = ledger.fail(claim, problems.too_large())
                say.warning("job failed: too large", error=str(error)[:200], held=held)
            return
        incident = uuid4().hex
        say.exception("job failed: internal", incident=incident)
        ledger.fail(claim, problems.internal(incident))


def _store(outcome: Outcome, blobs: Blobs) -> list[FileRef]:
    return [
        FileRef(name=name, media_type=media_type, bytes=len(data), sha256=blobs.put(data))
        for name, (media_type, data) in outcome.files.items()
    ]


def _reporter(claim: Claim, ledger: Ledger) -> Callable[[float], None]:
    """Tells of progress, but not of every hair's breadth, nor of every moment."""
    told, told_at = 0.0, time.monotonic()

    def report(fraction: float) -> None:
        nonlocal told, told_at
        now = time.monotonic()
        if fraction >= told + _PROGRESS_STEP and now - told_at >= _TOLD_EVERY_S:
            told, told_at = min(fraction, 1.0), now
            ledger.progress(claim, told)

    return report
