"""Before any route: who may reach this service at all, and how slowly a body may come.

Strategy: without API keys everybody who reaches the service may use it. So then only this machine
may: by the address that the connection came in on, however the server was started; and a web page
that somebody on this machine looks at may not, neither by naming us (``Origin``) nor by a name of
its own that leads here (``Host``).
"""

from __future__ import annotations

import asyncio
import ipaddress
import time
from functools import lru_cache
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.problems import ProblemError
from services.settings import ServiceSettings, is_loopback

_CHUNK_WITHIN_S = 15.0
_GRACE_S = 30.0
_SLOWEST_BYTES_S = 16 * 1024
_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")


class Gate:
    """ASGI middleware; raises ProblemError, which :class:`services.middleware.Requests` answers."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app = app
        self._settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if not self._settings.has_keys:
            _check_network(scope)
        self._check_host(headers.get("host", ""))
        streams = scope["type"] == "websocket"
        self._check_origin(headers, "POST" if streams else scope["method"])
        await self._app(scope, receive if streams else _Paced(receive), send)

    def _check_host(self, host: str) -> None:
        allowed = self._settings.allowed_hosts
        if self._settings.has_keys and not allowed:
            return
        if not _names_us(host, allowed):
            detail = (
                f"this service does not answer for the host {host[:100]!r}; see DLO_ALLOWED_HOSTS"
            )
            raise ProblemError(421, "foreign_host", detail)

    def _check_origin(self, headers: Headers, method: str) -> None:
        """A page may call us from our own address, or from one that the operator named."""
        origin, host = headers.get("origin"), headers.get("host", "")
        own = origin is None or _is_ours(origin, host, self._settings.allowed_hosts)
        followed = headers.get("sec-fetch-mode") == "navigate" and method in _SAFE_METHODS
        if not own or (
            headers.get("sec-fetch-site") == "cross-site" and origin is None and not followed
        ):
            raise ProblemError(
                403, "foreign_origin", "a web page from elsewhere may not use this service"
            )


class _Paced:
    """Receives as the server does, but a body that stalls, or drips, is given up."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._started = time.monotonic()
        self._bytes = 0
        self._whole = False

    async def __call__(self) -> Message:
        if self._whole:
            return await self._receive()
        try:
            async with asyncio.timeout(_CHUNK_WITHIN_S):
                message = await self._receive()
        except TimeoutError:
            raise _too_slow() from None
        self._bytes += len(message.get("body", b""))
        self._whole = not message.get("more_body", False)
        if (
            not self._whole
            and time.monotonic() - self._started > _GRACE_S + self._bytes / _SLOWEST_BYTES_S
        ):
            raise _too_slow()
        return message


def _too_slow() -> ProblemError:
    return ProblemError(
        408, "too_slow", "the body came too slowly", headers={"Connection": "close"}
    )


def _check_network(scope: Scope) -> None:
    """``server`` is the address that the connection came in on; a name there is a test's, a path a
    socket's."""
    address, _ = scope.get("server") or ("", None)
    if _leads_elsewhere(address):
        detail = "without API keys this service answers its own machine only; see DLO_API_KEYS_FILE"
        raise ProblemError(403, "keys_required", detail)


@lru_cache(maxsize=64)
def _names_us(host: str, allowed: tuple[str, ...]) -> bool:
    name = _hostname(f"//{host}")
    return is_loopback(name) or name.endswith(".localhost") or name in allowed


@lru_cache(maxsize=64)
def _leads_elsewhere(address: str) -> bool:
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return False
    return not is_loopback(str(getattr(found, "ipv4_mapped", None) or found))


def _is_ours(origin: str, host: str, allowed: tuple[str, ...]) -> bool:
    return origin.partition("://")[2] == host or _hostname(origin) in allowed


def _hostname(address: str) -> str:
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""
