"""Frames of a track over a WebSocket: the newest picture is looked at, older ones that wait are
dropped.

A client sends a picture as a binary message; a text message before it, ``{"time_s": 12.5, "number":
7}``, states when it was taken, and a number that its answer repeats. Each answer is a text message:
a frame result with ``dropped``, the pictures passed over since the answer before; or ``{"problem":
{…}}``, an RFC 9457 problem, and the stream goes on.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import NamedTuple

from dlo_client.contracts import StreamedFrame
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from services import frames
from services.access import Backend, Caller
from services.problems import ProblemError, field_error, problem_of
from workers.errors import TrackUnknown

_GOING_AWAY = 1001
REFUSED = 1008
"""Close code for a policy."""


class _About(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    time_s: float | None = Field(default=None, ge=0, le=1e12)
    number: int | None = Field(default=None, ge=0, le=2**53)


class _Taken(NamedTuple):
    """A picture, what was sent about it, and how many were dropped before it."""

    picture: bytes
    about: _About
    dropped: int


class _Newest:
    """One picture that waits: a newer one takes its place."""

    def __init__(self) -> None:
        self.dropped = 0
        self.ended = False
        self._picture: tuple[bytes, _About] | None = None
        self._news = asyncio.Event()

    def put(self, picture: bytes, about: _About) -> None:
        self.dropped += self._picture is not None
        self._picture = picture, about
        self._news.set()

    def end(self) -> None:
        self.ended = True
        self._news.set()

    async def take(self) -> _Taken | None:
        """None at the end."""
        await self._news.wait()
        if self._picture is None:
            return None
        taken = _Taken(*self._picture, self.dropped)
        self._picture, self.dropped = None, 0
        if not self.ended:
            self._news.clear()
        return taken


async def serve(socket: WebSocket, backend: Backend, caller: Caller, track_id: str) -> None:
    """Answer until the client closes, or the track is gone."""
    await socket.accept()
    newest = _Newest()
    reading = asyncio.create_task(_read(socket, newest, backend.settings.max_image_bytes))
    try:
        while (taken := await newest.take()) is not None:
            number = taken.about.number
            try:
                frame = await frames.answer(
                    backend, caller, track_id, {"image": taken.picture}, taken.about.time_s
                )
                answer = StreamedFrame(
                    **dict(frame), number=number, dropped=taken.dropped
                ).model_dump_json()
            except TrackUnknown as error:
                await socket.send_text(_problem(error, number))
                await socket.close(_GOING_AWAY)
                return
            except Exception as error:  # the stream goes on after a bad picture
                answer = _problem(error, number)
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
    about = _About()
    with suppress(WebSocketDisconnect):
        while (message := await socket.receive())["type"] == "websocket.receive":
            try:
                if (text := message.get("text")) is not None:
                    about = _about(text)
                    continue
                picture, sent, about = message.get("bytes") or b"", about, _About()
                if len(picture) <= most_bytes:
                    newest.put(picture, sent)
                    continue
                fault = field_error(
                    "image", f"is larger than {most_bytes} bytes", code="too_large", status=413
                )
                await socket.send_text(_problem(fault, sent.number))
            except ProblemError as error:
                await socket.send_text(_problem(error))
    newest.end()


def _about(text: str) -> _About:
    try:
        return _About.model_validate_json(text)
    except ValidationError as error:
        field = next((str(found["loc"][0]) for found in error.errors() if found["loc"]), "time_s")
        wanted = 'a text message is {"time_s": SECONDS, "number": INTEGER}, both optional, before its picture'
        raise field_error(field, wanted) from None


def _problem(error: Exception, number: int | None = None) -> str:
    problem = problem_of(error).problem
    numbered = {} if number is None else {"number": number}
    return json.dumps({"problem": problem.model_dump(mode="json", exclude_none=True), **numbered})
