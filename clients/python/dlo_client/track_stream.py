"""A track over one connection, for a camera that is faster than the service: old pictures are
dropped.

::

    with client.track() as track, track.stream() as stream:
        for picture in camera:
            stream.show(picture)
            while (frame := stream.answer(timeout_s=0)) is not None:
                print(frame.number, frame.cables)

At most two pictures are on their way; a third one waits here, and a newer one takes its place. So
an answer is never older than the two pictures before it take. One thread may show pictures while
another one takes the answers. Needs the extra: ``pip install "dlo-client[stream]"``.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, ExitStack
from types import TracebackType
from typing import Any, NamedTuple, Self

from pydantic import ValidationError
from websockets.asyncio.client import ClientConnection as AsyncConnection
from websockets.asyncio.client import connect as connect_on_loop
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

from dlo_client.connection import Address
from dlo_client.contracts import Problem, StreamedFrame
from dlo_client.errors import ConnectionFailed, DLOError, UnexpectedReply, refusal
from dlo_client.pictures import Picture, part_of
from dlo_client.times import time_of

_MOST_OUT = 2
"""One picture that is looked at, and the next one."""
_TURN_S = 1e-3
_MOST_ANSWER_BYTES = 64 * 2**20
_BROKEN = "the stream broke: {}"


class TrackStream:
    """Pictures in, frame results out; closed at the end of a ``with``. Its methods raise a
    DLOError: that of a picture which cannot be used leaves the stream open."""

    def __init__(self, connection: ClientConnection, opened: ExitStack) -> None:
        self._connection, self._opened = connection, opened
        self._pictures = _Pictures()
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def unanswered(self) -> int:
        """Pictures that were shown, and neither answered nor dropped yet."""
        return self._pictures.unanswered

    def show(self, image: Picture, *, time_s: float | None = None) -> int:
        """Hand in the newest picture; returns its number, from 1, which its answer repeats."""
        data, time_s = part_of(image, "image").data, time_of(time_s)
        with self._lock:
            number = self._pictures.put(data, time_s)
            self._send()
        return number

    def answer(self, timeout_s: float | None = None) -> StreamedFrame | None:
        """The next answer; None if there is none within ``timeout_s`` (0: none yet). Without it
        this waits."""
        try:
            text = self._connection.recv(timeout=timeout_s)
        except TimeoutError:
            return None
        except ConnectionClosed as error:
            raise ConnectionFailed(_BROKEN.format(error)) from error
        with self._lock:
            reply = self._pictures.answered(text)
            self._send()
        return reply.frame()

    def __iter__(self) -> Iterator[StreamedFrame]:
        """Answers until every picture shown so far is answered or dropped."""
        while self.unanswered and (frame := self.answer()) is not None:
            yield frame

    def close(self) -> None:
        self._opened.close()

    def _send(self) -> None:
        try:
            for message in self._pictures.due():
                self._connection.send(message)
        except ConnectionClosed as error:
            raise ConnectionFailed(_BROKEN.format(error)) from error


class AsyncTrackStream:
    """As :class:`TrackStream`, of an AsyncClient."""

    def __init__(self, connection: AsyncConnection, opened: AsyncExitStack) -> None:
        self._connection, self._opened = connection, opened
        self._pictures = _Pictures()
        self._lock = asyncio.Lock()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    @property
    def unanswered(self) -> int:
        """Pictures that were shown, and neither answered nor dropped yet."""
        return self._pictures.unanswered

    async def show(self, image: Picture, *, time_s: float | None = None) -> int:
        """Hand in the newest picture; returns its number, from 1, which its answer repeats."""
        data, time_s = (await asyncio.to_thread(part_of, image, "image")).data, time_of(time_s)
        async with self._lock:
            number = self._pictures.put(data, time_s)
            await self._send()
        return number

    async def answer(self, timeout_s: float | None = None) -> StreamedFrame | None:
        """The next answer; None if there is none within ``timeout_s`` (0: none yet). Without it
        this waits."""
        try:
            # A turn of the loop at least: what has come by then is there.
            async with asyncio.timeout(None if timeout_s is None else max(timeout_s, _TURN_S)):
                text = await self._connection.recv()
        except TimeoutError:
            return None
        except ConnectionClosed as error:
            raise ConnectionFailed(_BROKEN.format(error)) from error
        async with self._lock:
            reply = self._pictures.answered(text)
            await self._send()
        return reply.frame()

    async def __aiter__(self) -> AsyncIterator[StreamedFrame]:
        """Answers until every picture shown so far is answered or dropped."""
        while self.unanswered and (frame := await self.answer()) is not None:
            yield frame

    async def close(self) -> None:
        await self._opened.aclose()

    async def _send(self) -> None:
        try:
            for message in self._pictures.due():
                await self._connection.send(message)
        except ConnectionClosed as error:
            raise ConnectionFailed(_BROKEN.format(error)) from error


def opened(address: Address) -> TrackStream:
    """Raises ConnectionFailed, also where the service refuses the stream."""
    stack = ExitStack()
    try:
        return TrackStream(stack.enter_context(connect(address.url, **_options(address))), stack)
    except (OSError, InvalidHandshake, TimeoutError) as error:
        raise ConnectionFailed(f"the stream was not opened: {error}") from error


async def opened_on_loop(address: Address) -> AsyncTrackStream:
    """Raises ConnectionFailed, also where the service refuses the stream."""
    stack = AsyncExitStack()
    try:
        connection = await stack.enter_async_context(
            connect_on_loop(address.url, **_options(address))
        )
    except (OSError, InvalidHandshake, TimeoutError) as error:
        raise ConnectionFailed(f"the stream was not opened: {error}") from error
    return AsyncTrackStream(connection, stack)


def _options(address: Address) -> dict[str, Any]:
    return {
        "additional_headers": address.headers,
        "user_agent_header": None,
        "open_timeout": address.timeout_s,
        "max_size": _MOST_ANSWER_BYTES,
        "compression": None,  # pictures are compressed already
    }


class _Reply(NamedTuple):
    """A frame, or why there is none."""

    found: StreamedFrame | DLOError

    def frame(self) -> StreamedFrame:
        if isinstance(self.found, DLOError):
            raise self.found
        return self.found


class _Waiting(NamedTuple):
    number: int
    data: bytes
    time_s: float | None


class _Pictures:
    """Which pictures are on their way, which one waits, and how many were dropped before each."""

    def __init__(self) -> None:
        self._last = self._dropped = 0
        self._waiting: _Waiting | None = None
        self._out: dict[int, int] = {}

    @property
    def unanswered(self) -> int:
        return len(self._out) + (self._waiting is not None)

    def put(self, data: bytes, time_s: float | None) -> int:
        self._last += 1
        self._dropped += self._waiting is not None
        self._waiting = _Waiting(self._last, data, time_s)
        return self._last

    def due(self) -> list[str | bytes]:
        """Messages to be sent now: the picture that waits, where not too many are out."""
        waiting = self._waiting
        if waiting is None or len(self._out) >= _MOST_OUT:
            return []
        self._out[waiting.number], self._waiting, self._dropped = self._dropped, None, 0
        about = {"number": waiting.number, "time_s": waiting.time_s}
        return [
            json.dumps({name: value for name, value in about.items() if value is not None}),
            waiting.data,
        ]

    def answered(self, text: str | bytes) -> _Reply:
        """What an answer holds; the pictures up to its own are no longer out."""
        try:
            body = json.loads(text)
            number = body.get("number") or next(iter(self._out), 0)
            dropped = sum(self._out.pop(k) for k in [k for k in self._out if k <= number])
            if "problem" in body:
                return _Reply(refusal(Problem.model_validate(body["problem"]), None, None))
            frame = StreamedFrame.model_validate(body)
        except (ValueError, AttributeError, ValidationError) as error:
            return _Reply(UnexpectedReply(f"the stream's answer is none of this version: {error}"))
        return _Reply(frame.model_copy(update={"dropped": frame.dropped + dropped}))
