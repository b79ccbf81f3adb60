"""Frames of a track over a WebSocket: the newest picture is looked at, older ones that wait are dropped.

A client sends a picture as a binary message; a text message before it, ``{"time_s": 12.5}``, tells when it was taken.
Each answer is a text message: a frame result with ``dropped``, the pictures passed over since the answer before; or
``{"problem": {…}}``, an RFC 9457 problem, after which the stream goes on.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress

from dlo_client.contracts import FrameResult
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from services import frames
from services.access import Backend, Caller
from services.problems import ProblemError, field_error, problem_of
from workers.errors import TrackUnknown

_GOING_AWAY = 1001
REFUSED = 1008
"""Close code for a policy."""


class StreamedFrame(FrameResult):
    """A frame result as it is streamed."""

    dropped: int = Field(description="pictures that were passed over since the answer before")


class _About(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    time_s: float | None = Field(default=None, ge=0, le=1e12)


class _Newest:
    """One picture that waits: a newer one takes its place."""

    def __init__(self) -> None:
        self.dropped = 0
        self.ended = False
        self._picture: tuple[bytes, float | None] | None = None
        self._news = asyncio.Event()

    def put(self, picture: bytes, time_s: float | None) -> None:
        self.dropped += self._picture is not None
        self._picture = picture, time_s
        self._news.set()

    def end(self) -> None:
        self.ended = True
        self._news.set()

    async def take(self) -> tuple[bytes, float | None, int] | None:
        """The picture, its time, and how many were dropped before it; None at the end."""
        await self._news.wait()
        if self._picture is None:
            return None
        (picture, time_s), dropped = self._picture, self.dropped
        self._picture, self.dropped = None, 0
        if not self.ended:
            self._news.clear()
        return picture, time_s, dropped


async def serve(socket: WebSocket, backend: Backend, caller: Caller, track_id: str) -> None:
    """Answer until the client closes, or the track is gone."""
    await socket.accept()
    newest = _Newest()
    reading = asyncio.create_task(_read(socket, newest, backend.settings.max_image_bytes))
    try:
        while (taken := await newest.take()) is not None:
            picture, time_s, dropped = taken
            try:
                frame = await frames.answer(backend, caller, track_id, {"image": picture}, time_s)
                answer = StreamedFrame(**dict(frame), dropped=dropped).model_dump_json()
            except TrackUnknown as error:
                await socket.send_text(_problem(error))
                await socket.close(_GOING_AWAY)
                return
            except Exception as error:  # the stream goes on after a bad picture
                answer = _problem(error)
            await socket.send_text(answer)
    except WebSocketDisconnect:
        pass
    finally:
        reading.cancel()
        with suppress(asyncio.CancelledError):
            await reading


async def refuse(socket: WebSocket, error: Exception) -> None:
    """Close a stream that is not accepted, with the problem's code as the reason."""
    await socket.close(REFUSED, problem_of(error).problem.code)


async def _read(socket: WebSocket, newest: _Newest, most_bytes: int) -> None:
    """Messages into ``newest`` until the client closes."""
    time_s: float | None = None
    with suppress(WebSocketDisconnect):
        while (message := await socket.receive())["type"] == "websocket.receive":
            try:
                if (text := message.get("text")) is not None:
                    time_s = _time(text)
                    continue
                picture = message.get("bytes") or b""
                if len(picture) > most_bytes:
                    raise field_error("image", f"is larger than {most_bytes} bytes", code="too_large", status=413)
                newest.put(picture, time_s)
                time_s = None
            except ProblemError as error:
                await socket.send_text(_problem(error))
    newest.end()


def _time(text: str) -> float | None:
    try:
        return _About.model_validate_json(text).time_s
    except ValidationError:
        raise field_error("time_s", 'a text message is {"time_s": SECONDS}, before its picture') from None


def _problem(error: Exception) -> str:
    problem = problem_of(error).problem
    return json.dumps({"problem": problem.model_dump(mode="json", exclude_none=True)})
