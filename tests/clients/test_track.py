"""Both clients' tracks: what they send, what they return, what they refuse."""

from __future__ import annotations

import asyncio
import json

import httpx
import pytest
from dlo_client import AsyncClient, Client, FrameResult, InvalidArgument, TrackOptions, errors

from tests.clients import samples, track_samples
from tests.clients.replies import Reply, Script, ok, refusal, reply

PATH = f"/v1/tracks/{track_samples.TRACK_ID}"
REPLIES: list[Reply] = [
    ok(track_samples.info(), 201),
    ok(track_samples.frame(1)),
    ok(track_samples.frame(2)),
    reply(204),
]


def use(script: Script) -> list[FrameResult]:
    transport = httpx.MockTransport(script)
    with (
        Client("http://service", transport=transport) as client,
        client.track(TrackOptions(effort="fast")) as track,
    ):
        return [track.frame(b"one", time_s=0.5), track.frame(b"two", mask=b"a mask")]


async def use_on_loop(script: Script) -> list[FrameResult]:
    async with (
        AsyncClient("http://service", transport=httpx.MockTransport(script)) as client,
        await client.track(TrackOptions(effort="fast")) as track,
    ):
        return [await track.frame(b"one", time_s=0.5), await track.frame(b"two", mask=b"a mask")]


@pytest.mark.parametrize("on_loop", [False, True])
def test_a_track_is_begun_fed_and_ended(on_loop: bool) -> None:
    script = Script(*REPLIES)
    frames = asyncio.run(use_on_loop(script)) if on_loop else use(script)
    assert frames == [track_samples.frame(1), track_samples.frame(2)]
    begun, first, second, ended = script.requests
    assert json.loads(begun.content)["effort"] == "fast"
    assert (first.method, first.url.path, first.url.params["time_s"]) == (
        "POST",
        f"{PATH}/frames",
        "0.5",
    )
    assert b'name="image"' in first.content
    assert b"one" in first.content
    assert b'name="mask"' in second.content
    assert "time_s" not in second.url.params
    assert (ended.method, ended.url.path) == ("DELETE", PATH)


def test_a_track_that_is_forgotten_already_ends_without_an_error() -> None:
    gone = refusal(samples.refused(404, "unknown_track"))
    script = Script(ok(track_samples.info(), 201), gone)
    with Client("http://service", transport=httpx.MockTransport(script)) as client:
        track = client.track()
        track.end()
        with pytest.raises(errors.APIError) as refused:
            track.info()
    assert refused.value.problem.code == "unknown_track"


def test_frames_that_cannot_be_sent() -> None:
    script = Script(ok(track_samples.info(), 201))
    with Client("http://service", transport=httpx.MockTransport(script)) as client:
        track = client.track()
        for arguments, more, named in [
            ((), {}, "image"),
            ((b"x",), {"time_s": -1}, "time_s"),
            ((7,), {}, "image"),
        ]:
            with pytest.raises(InvalidArgument) as refused:
                track.frame(*arguments, **more)  # type: ignore[arg-type]
            assert refused.value.argument == named
        with pytest.raises(InvalidArgument):
            client.track({"effort": "fast"})  # type: ignore[arg-type]
    assert len(script.requests) == 1
