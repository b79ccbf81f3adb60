"""A sequence of pictures in which cables keep their ids: :class:`Track`, and its twin for an event
loop.

::

    with client.track() as track:
        for picture in camera:
            for cable in track.frame(picture).cables:
                print(cable.id, cable.state, cable.centerline_xy[0])
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote

from dlo_client.calls import Call, nothing, reader
from dlo_client.contracts import FrameResult, TrackInfo, TrackOptions
from dlo_client.errors import ConnectionFailed, InvalidArgument
from dlo_client.pictures import Picture, part_of
from dlo_client.times import time_of

if TYPE_CHECKING:
    from dlo_client.async_client import AsyncClient
    from dlo_client.client import Client
    from dlo_client.track_stream import AsyncTrackStream, TrackStream

_BINARY = "application/octet-stream"


class Track:
    """A track of the service; at the end of a ``with`` it is ended there."""

    def __init__(self, client: Client, info: TrackInfo) -> None:
        self._client = client
        self.id = info.id

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def frame(
        self,
        image: Picture | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        time_s: float | None = None,
    ) -> FrameResult:
        """What the next picture shows: the picture, its foreground ``mask``, its ``depth``, or
        several of these. ``time_s`` is when it was taken; without it, pictures are equally far
        apart."""
        return self._client.send(
            frame(self.id, {"image": image, "mask": mask, "depth": depth}, time_s)
        )

    def stream(self) -> TrackStream:
        """Pictures of a fast camera over one connection: see :mod:`dlo_client.track_stream`."""
        with _needing_extra():
            from dlo_client.track_stream import opened
        try:
            return opened(self._client.stream_address(f"{_path(self.id)}/stream"))
        except ConnectionFailed:
            self.info()  # where the track or the key is refused, this gives the reason
            raise

    def info(self) -> TrackInfo:
        """How many frames it had, how many cables it knows, when it will be forgotten."""
        return self._client.send(look(self.id))

    def end(self) -> None:
        """Forget it; nothing happens where it is forgotten already."""
        self._client.send(end(self.id))


class AsyncTrack:
    """As :class:`Track`, of an AsyncClient."""

    def __init__(self, client: AsyncClient, info: TrackInfo) -> None:
        self._client = client
        self.id = info.id

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.end()

    async def frame(
        self,
        image: Picture | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        time_s: float | None = None,
    ) -> FrameResult:
        """What the next picture shows: the picture, its foreground ``mask``, its ``depth``, or
        several of these. ``time_s`` is when it was taken; without it, pictures are equally far
        apart."""
        return await self._client.send(
            frame(self.id, {"image": image, "mask": mask, "depth": depth}, time_s)
        )

    async def stream(self) -> AsyncTrackStream:
        """Pictures of a fast camera over one connection: see :mod:`dlo_client.track_stream`."""
        with _needing_extra():
            from dlo_client.track_stream import opened_on_loop
        try:
            return await opened_on_loop(self._client.stream_address(f"{_path(self.id)}/stream"))
        except ConnectionFailed:
            await self.info()  # where the track or the key is refused, this gives the reason
            raise

    async def info(self) -> TrackInfo:
        """How many frames it had, how many cables it knows, when it will be forgotten."""
        return await self._client.send(look(self.id))

    async def end(self) -> None:
        """Forget it; nothing happens where it is forgotten already."""
        await self._client.send(end(self.id))


def begin(options: TrackOptions | None) -> Call[TrackInfo]:
    if not isinstance(options, TrackOptions | None):
        raise InvalidArgument("options", f"{type(options).__name__} is no TrackOptions")
    body = (options or TrackOptions()).model_dump(mode="json", exclude_none=True)
    return Call("POST", "/v1/tracks", reader(TrackInfo), body={"json": body})


def look(track_id: str) -> Call[TrackInfo]:
    return Call("GET", _path(track_id), reader(TrackInfo))


def end(track_id: str) -> Call[None]:
    return Call("DELETE", _path(track_id), nothing, fine=(404,))


def frame(
    track_id: str, given: Mapping[str, Picture | None], time_s: float | None
) -> Call[FrameResult]:
    if not any(picture is not None for picture in given.values()):
        raise InvalidArgument("image", "give a picture, its mask, or its depth")
    time_s = time_of(time_s)
    parts = {name: part_of(picture, name) for name, picture in given.items() if picture is not None}
    body: dict[str, Any] = {
        "files": {name: (part.name, part.data, _BINARY) for name, part in parts.items()}
    }
    params: dict[str, float] = {} if time_s is None else {"time_s": time_s}
    return Call(
        "POST",
        f"{_path(track_id)}/frames",
        reader(FrameResult),
        params=params,
        body=body,
        held_s=_LONGEST_S,
    )


@contextmanager
def _needing_extra() -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        raise InvalidArgument("stream", _NEEDS_EXTRA.format(name=error.name)) from error


_NEEDS_EXTRA = 'needs the extra: pip install "dlo-client[stream]" (not found: {name})'
_LONGEST_S = 60.0
"""The longest time limit of a frame."""


def _path(track_id: str) -> str:
    return f"/v1/tracks/{quote(track_id, safe='')}"
