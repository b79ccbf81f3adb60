"""``/v1/tracks``: sequences of pictures in which cables keep their ids."""

from __future__ import annotations

from contextlib import aclosing
from typing import Annotated

from dlo_client.contracts import FrameResult, TrackInfo, TrackOptions
from fastapi import APIRouter, Depends, Path, Query, Request, Response, WebSocket
from redis.exceptions import RedisError

from services import documents, frame_stream, frames
from services.access import (
    Backend,
    BackendDep,
    Caller,
    Reader,
    Submitter,
    has_form_of_id,
    streaming_caller,
)
from services.multipart import Allowed, media_type, parts, whole
from services.problems import ProblemError, field_error
from workers.errors import TrackUnknown
from workers.tracks import TrackRecord

router = APIRouter(prefix="/v1/tracks", tags=["tracks"])

TimeS = Annotated[
    float | None,
    Query(
        ge=0,
        le=1e12,
        allow_inf_nan=False,
        description="when it was taken; default: frames are equally far apart",
    ),
]


async def _track_id(track_id: Annotated[str, Path(description="as in the track")]) -> str:
    if not has_form_of_id(track_id):
        raise TrackUnknown(track_id)
    return track_id


TrackId = Annotated[str, Depends(_track_id)]


async def _seen_by(caller: Caller, track_id: str, backend: Backend) -> TrackRecord:
    record = await backend.tracks.get(track_id)
    if caller.sees not in (None, record.owner):
        raise TrackUnknown(track_id)
    return record


async def _record(track_id: TrackId, caller: Reader, backend: BackendDep) -> TrackRecord:
    return await _seen_by(caller, track_id, backend)


async def _own_record(track_id: TrackId, caller: Submitter, backend: BackendDep) -> TrackRecord:
    return await _seen_by(caller, track_id, backend)


Existing = Annotated[TrackRecord, Depends(_record)]
Own = Annotated[TrackRecord, Depends(_own_record)]


@router.post("", status_code=201, responses=documents.problems(403, 413, 415, 429))
async def begin_track(
    caller: Submitter,
    backend: BackendDep,
    request: Request,
    response: Response,
    options: TrackOptions | None = None,
) -> TrackInfo:
    """Begin a track. It is forgotten when no frame has come for a while (`expires_at`)."""
    text = (options or TrackOptions()).model_dump_json()
    record = await backend.tracks.open(text, caller.owner)
    response.headers["Location"] = request.app.url_path_for("read_track", track_id=record.id)
    return frames.described(record)


@router.get("/{track_id}", responses=documents.problems(403, 404, 429))
async def read_track(record: Existing) -> TrackInfo:
    """The track: how many frames it had, how many cables it knows."""
    return frames.described(record)


@router.delete("/{track_id}", status_code=204, responses=documents.problems(403, 404, 429))
async def end_track(record: Own, backend: BackendDep) -> None:
    """Forget the track."""
    await backend.tracks.drop(record.id)


@router.post(
    "/{track_id}/frames",
    responses=documents.problems(403, 404, 408, 409, 413, 415, 429, 507),
    openapi_extra={"requestBody": documents.FRAME},
)
async def add_frame(
    request: Request, record: Own, caller: Submitter, backend: BackendDep, time_s: TimeS = None
) -> FrameResult:
    """What the next picture shows; frames of one track are answered one after the other."""
    pictures = await _pictures(request, backend)
    return await frames.answer(backend, caller, record.id, pictures, time_s)


@router.websocket("/{track_id}/stream")
async def stream(socket: WebSocket, track_id: str) -> None:
    """Pictures in as binary messages, frame results out as text; see
    :mod:`services.frame_stream`."""
    backend: Backend = socket.app.state.backend
    try:
        async with streaming_caller(socket, backend, "submit") as caller:
            record = await _seen_by(caller, await _track_id(track_id), backend)
            await frame_stream.serve(socket, backend, caller, record.id)
    except (ProblemError, TrackUnknown, RedisError) as error:
        await frame_stream.refuse(socket, error)


async def _pictures(request: Request, backend: Backend) -> dict[str, bytes]:
    """The body, or its parts ``image``, ``mask`` and ``depth``."""
    limit = backend.settings.max_image_bytes
    kind = media_type(request)
    if kind != "multipart/form-data":
        if kind and kind != "application/octet-stream" and not kind.startswith("image/"):
            detail = f"send the picture as image/*, application/octet-stream or multipart/form-data, not {kind}"
            raise ProblemError(415, "unsupported_media_type", detail)
        return {"image": await whole(request, field="image", max_bytes=limit)}
    found: dict[str, bytes] = {}
    async with aclosing(
        parts(request, dict.fromkeys(("image", "mask", "depth"), Allowed(1, limit)))
    ) as stream:
        async for part in stream:
            found[part.name] = part.data
    if not found:
        raise field_error("image", "this part is missing: it holds the picture")
    return found
