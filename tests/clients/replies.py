"""What a mocked network answers, and what it was asked."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from functools import partial
from typing import Any

import httpx
from dlo_client.contracts import Contract, JobEvent, JobState, Problem

Reply = Callable[[], httpx.Response] | Exception
"""Made anew each time: a response knows which client has read it."""


class Script:
    """Gives the prepared replies in order, the last one for ever; keeps the requests."""

    def __init__(self, *replies: Reply) -> None:
        self._replies = list(replies)
        self.requests: list[httpx.Request] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        reply = self._replies.pop(0) if len(self._replies) > 1 else self._replies[0]
        if isinstance(reply, Exception):
            raise reply
        return reply()


class Breaking(httpx.SyncByteStream, httpx.AsyncByteStream):
    """A body that breaks off after its text."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __iter__(self) -> Iterator[bytes]:
        yield self._text.encode()
        raise httpx.ReadError("connection lost")

    async def __aiter__(self) -> AsyncIterator[bytes]:
        for chunk in self:
            yield chunk


def reply(status: int = 200, **content: Any) -> Reply:
    """``content`` in httpx's arguments: ``text``, ``headers``, ``stream`` …"""
    return partial(httpx.Response, status, **content)


def ok(contract: Contract, status: int = 200) -> Reply:
    return reply(status, text=contract.model_dump_json())


def refusal(problem: Problem, headers: Mapping[str, str] | None = None) -> Reply:
    return reply(problem.status, text=problem.model_dump_json(), headers=headers)


def event(number: int, state: JobState = JobState.RUNNING, progress: float = 0.5) -> str:
    data = JobEvent(id=f"{number}-0", state=state, progress=progress).model_dump_json()
    return f"id: {number}-0\ndata: {data}\n\n"
