"""HTTP connections with limits: how many, and how long one may take to state its request.

For ``uvicorn --http services.http_protocol:BoundedHttp``; ``python -m services`` uses it by itself.
"""

from __future__ import annotations

import asyncio
import resource
import sys
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from services.problems import ProblemError, response_of

HEADERS_WITHIN_S = 15.0
KEEP_ALIVE_S = 20
"""An idle connection stays for longer than clients use it again (httpx for 5 s, as uvicorn does,
aiohttp for 15): a request would now and then meet its closing."""
REST_WITHIN_S = 10.0
"""For the rest of a body whose request is already answered."""

_DESCRIPTORS = 65_536
_SPARE_DESCRIPTORS = 100
_DESCRIPTORS_EACH = 2  # a request that waits holds a connection to the queue as well


def connection_limit(asked: int) -> int:
    """What was asked for, but never more than there are descriptors for; raises their limit if it
    can."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, _DESCRIPTORS)
    if soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = most
    return max(1, min(asked, (soft - _SPARE_DESCRIPTORS) // _DESCRIPTORS_EACH))


class BoundedHttp(HttpToolsProtocol):
    """uvicorn's protocol with a limit on connections and on the time for headers and left-over
    bodies."""

    most = sys.maxsize
    """Set by :func:`limit_connections`."""
    _timer: asyncio.TimerHandle | None = None
    _whole = True

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.timeout_keep_alive = KEEP_ALIVE_S

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > BoundedHttp.most:
            transport.write(_full())
            transport.close()
        else:
            self._close_after(HEADERS_WITHIN_S)

    def connection_lost(self, exc: Exception | None) -> None:
        self._let_be()
        super().connection_lost(exc)

    def on_message_begin(self) -> None:
        self._whole = False
        if self._timer is None:
            self._close_after(HEADERS_WITHIN_S)
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        self._let_be()
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        self._whole = True
        self._let_be()
        super().on_message_complete()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        if not self._whole:
            self._close_after(REST_WITHIN_S)

    def _close_after(self, seconds: float) -> None:
        self._let_be()
        self._timer = self.loop.call_later(seconds, self.transport.close)

    def _let_be(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def limit_connections(asked: int) -> None:
    """Of every server of this process."""
    BoundedHttp.most = connection_limit(asked)


def _full() -> bytes:
    problem = ProblemError(
        503,
        "too_many_connections",
        "the service has as many connections as it may",
        headers={"Retry-After": "2"},
    )
    response = response_of(problem)
    lines = [b"%s: %s\r\n" % header for header in response.raw_headers]
    return b"".join(
        [b"HTTP/1.1 503 Service Unavailable\r\n", *lines, b"\r\n", bytes(response.body)]
    )
