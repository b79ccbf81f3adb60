"""A frame of a track: an ``instances`` job that continues the track's state, and its answer."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial

from anyio import to_thread
from dlo_client.contracts import (
    FrameResult,
    ImageRef,
    InstancesRequest,
    InstancesResult,
    TrackInfo,
    TrackOptions,
)
from pydantic import ValidationError
from pydantic_core import from_json

from services import waiting
from services.access import Backend, Caller
from services.fields import body_problems
from services.problems import ProblemError, field_error, fields_error
from services.telemetry import origin
from workers.blobs import Staged
from workers.record import Entry, JobRecord
from workers.tracks import TrackRecord

_SPARE_S = 5.0
"""A frame's hold on its track outlives its job's time limit by so much."""
_WAIT_FOR_OTHERS_S = 2.0
"""A frame waits so long for the one before it."""
_OF_A_NETWORK = ("model", "reference")
"""Options that have no meaning beside a mask."""
_KEPT_S = 120.0
"""Pictures of frames are not wanted again."""


def described(record: TrackRecord) -> TrackInfo:
    """What the API states of a track."""
    options = TrackOptions.model_validate_json(record.options)
    return TrackInfo(
        id=record.id,
        label=options.label,
        options=options,
        frames=record.frames,
        cables=record.cables,
        created_at=datetime.fromtimestamp(record.created_at, UTC),
        expires_at=datetime.fromtimestamp(record.expires_at, UTC),
    )


async def answer(
    backend: Backend,
    caller: Caller,
    track_id: str,
    pictures: dict[str, bytes],
    time_s: float | None,
) -> FrameResult:
    """What the ``pictures`` (``image``, ``mask``, ``depth``) of the next frame show.

    Raises:
        ProblemError: naming the field at fault, or that the frame took too long.
        TrackUnknown, TrackBusy, QueueFull: as the track's and the queue's doors do.
    """
    options = TrackOptions.model_validate_json((await backend.tracks.get(track_id)).options)
    await to_thread.run_sync(backend.queue.check_room, None, caller.owner, caller.most_jobs)
    token = await backend.tracks.hold(track_id, options.timeout_s + _SPARE_S, _WAIT_FOR_OTHERS_S)
    try:
        record = await backend.tracks.get(track_id)
        async with _staged(backend, pictures) as staged:
            request = _request(
                caller, options, record, {name: one.blob_id for name, one in staged.items()}, time_s
            )
            job = await _run(backend, caller, request, list(staged.values()))
            result = _result(job)
        frame = _frame(result, time_s)
        text = frame.track.model_dump_json()
        await backend.tracks.store(track_id, token, text, frame.frame, len(frame.track.cables))
        return frame
    finally:
        await backend.tracks.release(track_id, token)


@asynccontextmanager
async def _staged(backend: Backend, pictures: dict[str, bytes]) -> AsyncIterator[dict[str, Staged]]:
    """The pictures on the disk by field, checked; afterwards they are soon swept away."""
    staged: dict[str, Staged] = {}
    sizes = {}
    try:
        for name, data in pictures.items():
            info, staged[name] = await backend.uploads.stage(data, field=name)
            sizes[name] = (info.width, info.height)
        for name, size in sizes.items():
            first = next(iter(sizes))
            if size != sizes[first]:
                raise field_error(name, f"has another size than the {first}", code="size_mismatch")
        yield staged
    finally:
        for one in staged.values():
            await to_thread.run_sync(one.drop)
            await to_thread.run_sync(backend.blobs.let_go, one, _KEPT_S)


def _request(
    caller: Caller,
    options: TrackOptions,
    record: TrackRecord,
    ids: dict[str, str],
    time_s: float | None,
) -> InstancesRequest:
    given = options.model_dump(exclude_none=True, exclude={"label"})
    if "mask" in ids:
        given = {name: value for name, value in given.items() if name not in _OF_A_NETWORK}
    fields = {
        "default_model": caller.model,
        **given,
        **{name: ImageRef(id=blob_id) for name, blob_id in ids.items()},
        "previous": from_json(record.state) if record.state else {},
        "time_s": time_s,
        "files": [],
        "label": f"track {record.id}",
    }
    try:
        return InstancesRequest.model_validate(fields)
    except ValidationError as error:
        found = body_problems(
            error.errors(include_url=False, include_input=False), fields, whole="frame"
        )
        raise fields_error(found, len(found)) from None


async def _run(
    backend: Backend, caller: Caller, request: InstancesRequest, staged: list[Staged]
) -> JobRecord:
    """The ended job of a frame."""

    def keep() -> None:
        for one in staged:
            one.keep()

    put = partial(
        backend.queue.put,
        Entry.of(request),
        keep=keep,
        origin=origin(caller.owner),
        most_jobs=caller.most_jobs,
    )
    job_id, _ = await to_thread.run_sync(put)
    try:
        record = await waiting.ended(backend.waiting, job_id, request.timeout_s)
    except BaseException:
        await to_thread.run_sync(backend.queue.cancel, job_id)  # nobody waits for it any longer
        raise
    if not record.job.state.final:
        await to_thread.run_sync(backend.queue.cancel, job_id)
        detail = f"the frame was not done within {request.timeout_s:g} s; send the next one"
        raise ProblemError(503, "frame_too_slow", detail, headers={"Retry-After": "1"})
    return record


def _result(record: JobRecord) -> InstancesResult:
    if record.result is None:
        problem = record.job.problem
        if problem is None:
            raise ProblemError(409, "frame_cancelled", "the job of this frame was cancelled")
        raise ProblemError(
            problem.status,
            problem.code,
            problem.detail,
            errors=problem.errors,
            incident=problem.incident,
        )
    return InstancesResult.model_validate_json(record.result)


def _frame(result: InstancesResult, time_s: float | None) -> FrameResult:
    if result.track is None:
        raise RuntimeError("an instances job with `previous` answers with a track")
    return FrameResult(
        frame=result.track.frame,
        time_s=time_s,
        width=result.width,
        height=result.height,
        cables=result.cables or [],
        crossings=result.cable_crossings or [],
        track=result.track,
    )
