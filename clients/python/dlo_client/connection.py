"""Where the service is and who asks: from the arguments, else from the environment."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, NamedTuple

import httpx

from dlo_client.errors import ConnectionFailed, InvalidArgument
from dlo_client.version import __version__

DEFAULT_URL = "http://127.0.0.1:8000"
DEFAULT_TIMEOUT_S = 20.0
POLL_PAUSE_S = 0.05
"""Between two long polls, so that a service that does not hold them is not flooded."""

URL_VARIABLE = "DLO_URL"
KEY_VARIABLE = "DLO_API_KEY"

CONNECTION = "dlo_client.connection"
"""Under this name the ``dlo`` command keeps its :class:`Connection` in the context."""


@dataclass(frozen=True)
class Connection:
    """How to reach the service, for a command that opens a client of its own. ``transport`` as a
    client takes it."""

    url: str | None
    key: str | None
    transport: Any = None


def base_url(given: str | None) -> httpx.URL:
    """``given``, else ``DLO_URL``, else the address ``make serve`` listens on. Raises
    ConnectionFailed."""
    text = given or os.environ.get(URL_VARIABLE) or DEFAULT_URL
    try:
        url = httpx.URL(text)
    except (httpx.InvalidURL, TypeError) as error:
        raise ConnectionFailed(f"{text!r} is not an address: {error}") from error
    if url.scheme not in ("http", "https") or not url.host:
        raise ConnectionFailed(f"{text!r} is not an address such as {DEFAULT_URL}")
    return url


def base_headers(api_key: str | None) -> dict[str, str]:
    """Who asks; the key is ``api_key``, else ``DLO_API_KEY``, else none is sent. Raises
    InvalidArgument."""
    agent = {"User-Agent": f"dlo-client/{__version__}"}
    key = (
        api_key or os.environ.get(KEY_VARIABLE) or ""
    ).strip()  # a key from a file ends in a line break
    return agent | {"Authorization": f"Bearer {header_value(key, 'api_key')}"} if key else agent


def header_value(text: str, argument: str) -> str:
    """``text``; raises InvalidArgument, without repeating it, when it cannot stand in a header."""
    if not isinstance(text, str) or not text.isascii() or not text.isprintable():
        raise InvalidArgument(argument, "takes printable ASCII characters only")
    return text


class Address(NamedTuple):
    """Where a stream is, and who asks; ``timeout_s`` to open it."""

    url: str
    headers: dict[str, str]
    timeout_s: float


def stream_address(http: httpx.Client | httpx.AsyncClient, path: str, timeout_s: float) -> Address:
    """Of the WebSocket at ``path``, with what every request of ``http`` has. Raises
    ConnectionFailed."""
    if http.is_closed:
        raise ConnectionFailed("this client has been closed")
    request = http.build_request("GET", path)
    url = request.url.copy_with(scheme="wss" if request.url.scheme == "https" else "ws")
    sent = {name: request.headers[name] for name in _OF_A_STREAM if name in request.headers}
    return Address(str(url), sent, timeout_s)


_OF_A_STREAM = ("User-Agent", "Authorization")
"""The other headers of a request are the WebSocket's own."""
