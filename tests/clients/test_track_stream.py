"""A track over a WebSocket: at most two pictures are on their way, newer ones take the place of
those that wait."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import numpy as np
import pytest
from dlo_client import (
    AsyncClient,
    Client,
    ConnectionFailed,
    InvalidArgument,
    UnexpectedReply,
    errors,
)
from dlo_client.contracts import StreamedFrame
from dlo_client.track_stream import TrackStream
from websockets.datastructures import Headers
from websockets.sync.server import ServerConnection, serve

from tests.clients import samples, track_samples
from tests.clients.replies import ok, refusal, reply

WAIT_S = 20.0


class Service:
    """The stream's end at the service: answers the pictures it got when ``free`` is released, once
    for each."""

    def __init__(self) -> None:
        self.free = threading.Semaphore(0)
        self.got: list[tuple[dict[str, Any], bytes]] = []
        self.headers = Headers()
        self.replies: list[str] = []

    def __call__(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        self.headers = connection.request.headers
        for text in connection:
            picture = connection.recv(timeout=WAIT_S)
            assert isinstance(picture, bytes)
            self.got.append((json.loads(text), picture))
            assert self.free.acquire(timeout=WAIT_S)
            connection.send(
                self.replies.pop(0) if self.replies else self.frame(self.got[-1][0]["number"])
            )

    def frame(self, number: int) -> str:
        frame = track_samples.frame(len(self.got))
        return StreamedFrame(**dict(frame), number=number, dropped=0).model_dump_json()


@contextmanager
def serving(service: Service) -> Iterator[str]:
    """Its address."""
    with serve(service, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()
        thread.join()


@pytest.fixture
def service() -> Service:
    return Service()


def network(address: str) -> httpx.MockTransport:
    """Begins and ends the track; the stream itself goes to ``address``."""
    return httpx.MockTransport(
        lambda r: reply(204)() if r.method == "DELETE" else ok(track_samples.info(), 201)()
    )


@contextmanager
def streaming(service: Service) -> Iterator[TrackStream]:
    with (
        serving(service) as address,
        Client(address, transport=network(address)) as client,
        client.track().stream() as stream,
    ):
        yield stream


def use(service: Service, address: str) -> list[StreamedFrame]:
    with (
        Client(address, "key", transport=network(address)) as client,
        client.track() as track,
        track.stream() as stream,
    ):
        numbers = [stream.show(b"picture %d" % k, time_s=0.5 * k) for k in range(6)]
        assert numbers == [1, 2, 3, 4, 5, 6]
        assert (stream.unanswered, stream.answer(timeout_s=0)) == (3, None)
        service.free.release()
        looks = (stream.answer(timeout_s=0.01 * (k % 2)) for k in range(12_000))
        first = next(frame for frame in looks if frame is not None)
        service.free.release(2)
        return [first, *stream]


async def use_on_loop(service: Service, address: str) -> list[StreamedFrame]:
    async with (
        AsyncClient(address, "key", transport=network(address)) as client,
        await client.track() as track,
        await track.stream() as stream,
    ):
        numbers = [await stream.show(b"picture %d" % k, time_s=0.5 * k) for k in range(6)]
        assert numbers == [1, 2, 3, 4, 5, 6]
        assert (stream.unanswered, await stream.answer(timeout_s=0)) == (3, None)
        service.free.release()
        first = None
        for k in range(20_000):
            first = await stream.answer(timeout_s=0)
            if first is not None:
                break
            if k % 20 == 0:
                await asyncio.sleep(0.05)
        assert first is not None
        service.free.release(2)
        return [first, *[frame async for frame in stream]]


@pytest.mark.parametrize("on_loop", [False, True])
def test_two_pictures_are_out_and_of_the_rest_only_the_newest_is_sent(
    service: Service, on_loop: bool
) -> None:
    with serving(service) as address:
        frames = asyncio.run(use_on_loop(service, address)) if on_loop else use(service, address)
    assert [(frame.number, frame.dropped, frame.frame) for frame in frames] == [
        (1, 0, 1),
        (2, 0, 2),
        (6, 3, 3),
    ]
    assert [picture for _, picture in service.got] == [b"picture 0", b"picture 1", b"picture 5"]
    assert [about["time_s"] for about, _ in service.got] == [0.0, 0.5, 2.5]
    assert service.headers["Authorization"] == "Bearer key"
    assert service.headers["User-Agent"].startswith("dlo-client/")


def test_a_picture_that_is_refused_leaves_the_stream_open(service: Service) -> None:
    problem = samples.refused(422, "invalid_request").model_dump(mode="json", exclude_none=True)
    service.replies = [json.dumps({"problem": problem, "number": 1}), "[1]", '{"number": 3}']
    service.free.release(4)
    with streaming(service) as stream:
        stream.show(b"no picture")
        with pytest.raises(errors.InvalidRequest) as refused:
            stream.answer()
        for _ in range(2):
            stream.show(b"answered with something else")
            with pytest.raises(UnexpectedReply):
                stream.answer()
        number = stream.show(np.zeros((4, 4), np.uint8))
        assert [frame.number for frame in stream] == [number]
    assert refused.value.problem.code == "invalid_request"
    assert service.got[-1][1].startswith(b"\x89PNG")


def test_a_stream_that_breaks(service: Service) -> None:
    with streaming(service) as stream:
        stream.close()
        for use_it in (lambda: stream.show(b"picture"), stream.answer):
            with pytest.raises(ConnectionFailed, match="the stream broke"):
                use_it()


def test_what_cannot_be_shown(service: Service) -> None:
    wrong: list[tuple[Any, float | None, str]] = [
        (7, None, "image"),
        (b"x", -1.0, "time_s"),
        (b"x", np.nan, "time_s"),
    ]
    with streaming(service) as stream:
        for picture, time_s, named in wrong:
            with pytest.raises(InvalidArgument) as refused:
                stream.show(picture, time_s=time_s)
            assert refused.value.argument == named
        assert stream.unanswered == 0
    assert service.got == []


def test_a_stream_that_is_refused_tells_why() -> None:
    """The handshake of a track that is gone fails without a reason: the track itself is asked."""
    gone = refusal(samples.refused(404, "unknown_track"))
    transport = httpx.MockTransport(
        lambda r: gone() if r.method == "GET" else ok(track_samples.info(), 201)()
    )
    with (
        Client("http://127.0.0.1:1", transport=transport) as client,
        pytest.raises(errors.NotFound),
    ):
        client.track().stream()
    with (
        Client("http://127.0.0.1:1", transport=network("")) as client,
        pytest.raises(ConnectionFailed),
    ):
        client.track().stream()
