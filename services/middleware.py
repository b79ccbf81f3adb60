"""Around every request: its id, one line in the log, its duration, and an answer to what nobody
caught."""

from __future__ import annotations

import re
import time
import uuid

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.headers import secure
from services.metrics import RequestDurations
from services.problems import problem_of, response_of

log = structlog.get_logger(__name__)

_CLIENT_IS_GONE = 499
_REFUSED = 1008
"""Close code of a WebSocket for a policy."""
_SAFE_ID = re.compile(r"[\w.:/+=-]{1,128}", re.ASCII)


class Requests:
    """ASGI middleware; outermost, so that the answer to an error of ours carries the request's id
    too."""

    def __init__(self, app: ASGIApp, durations: RequestDurations) -> None:
        self._app = app
        self._durations = durations

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await _streamed(self._app, scope, receive, send)
            return
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started = time.perf_counter()
        request_id = _request_id(scope)
        status = 0

        async def tagged_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                secure(headers, scope["path"])
            await send(message)

        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self._app(scope, receive, tagged_send)
            except ClientDisconnect:
                pass
            except Exception as error:
                if status:  # the answer has begun: all that is left is to break it off
                    raise
                await response_of(problem_of(error))(scope, receive, tagged_send)
            finally:
                self._record(scope, status or _CLIENT_IS_GONE, time.perf_counter() - started)

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        method = scope["method"]
        route = getattr(scope.get("route"), "path", "none")
        self._durations.observe(method, route, status, seconds)
        milliseconds = round(seconds * 1000, 1)
        log.info("request", method=method, path=scope["path"], status=status, ms=milliseconds)


async def _streamed(app: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
    """A WebSocket; one that is refused before it is accepted is closed with the problem's code as
    the reason."""
    accepted = False

    async def noting_send(message: Message) -> None:
        nonlocal accepted
        accepted = accepted or message["type"] in ("websocket.accept", "websocket.close")
        await send(message)

    try:
        await app(scope, receive, noting_send)
    except Exception as error:
        if accepted:
            raise
        problem = problem_of(error).problem
        await send({"type": "websocket.close", "code": _REFUSED, "reason": problem.code})


def _request_id(scope: Scope) -> str:
    """The caller's id if it is harmless in a header and a log, else a new one."""
    given = Headers(scope=scope).get("x-request-id", "")
    return given if _SAFE_ID.fullmatch(given) else uuid.uuid4().hex
