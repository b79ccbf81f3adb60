"""Connections to the queue server: impatient ones for answering people, patient ones for
workers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import redis
import redis.asyncio
from redis.asyncio.retry import Retry as AsyncRetry
from redis.backoff import ConstantBackoff
from redis.retry import Retry

from workers.settings import Settings

LONGEST_BLOCK_MS = 10_000
"""No call blocks longer than this, so that a dead connection is noticed."""

_SOCKET_TIMEOUT_S = LONGEST_BLOCK_MS / 1000 + 5.0
_CONNECT_TIMEOUT_S = 2.0
_MAX_CONNECTIONS = 4096
_PAUSE_S = 0.25
_FULL_DISK = "MISCONF"
_CANNOT_WRITE = (redis.exceptions.OutOfMemoryError, redis.ReadOnlyError)

T = TypeVar("T")


class Patience(Retry):
    """Also waits for a server that is there and cannot write: its disk or its memory is full, or it
    is a replica."""

    def call_with_retry(self, do: Callable[..., T], *rest: Any, **named: Any) -> T:
        """See redis-py."""

        def ask(*arguments: Any) -> T:
            try:
                return do(*arguments)
            except redis.ResponseError as error:
                if isinstance(error, _CANNOT_WRITE) or _FULL_DISK in str(error):
                    raise redis.ConnectionError(str(error)) from error
                raise

        return super().call_with_retry(ask, *rest, **named)


def connect(settings: Settings, *, patient: bool = False, text: bool = True) -> redis.Redis:
    """A client; a patient one waits for a server that is away, for ever, instead of raising.

    It answers text, which is all that a job's record holds; RQ needs one that answers bytes.
    """
    retry = (
        Patience(ConstantBackoff(_PAUSE_S), -1) if patient else Retry(ConstantBackoff(_PAUSE_S), 1)
    )
    return redis.Redis.from_url(
        settings.redis_url,
        **_access(settings),
        retry=retry,
        decode_responses=text,
        socket_timeout=_SOCKET_TIMEOUT_S,
        socket_connect_timeout=_CONNECT_TIMEOUT_S,
        max_connections=_MAX_CONNECTIONS,
    )


def connect_async(settings: Settings) -> redis.asyncio.Redis:
    """The impatient client for an event loop."""
    return redis.asyncio.Redis.from_url(
        settings.redis_url,
        **_access(settings),
        retry=AsyncRetry(ConstantBackoff(_PAUSE_S), 1),
        decode_responses=True,
        socket_timeout=_SOCKET_TIMEOUT_S,
        socket_connect_timeout=_CONNECT_TIMEOUT_S,
        max_connections=_MAX_CONNECTIONS,
    )


def _access(settings: Settings) -> dict[str, Any]:
    """What an address does not hold: the password, and whom to believe that the server is who it
    claims to be."""
    given: dict[str, Any] = {}
    if settings.redis_password_file:
        given["password"] = settings.redis_password_file.read_text(encoding="utf-8").strip()
    if settings.redis_url.startswith("rediss://") and settings.redis_ca_file:
        given["ssl_ca_certs"] = str(settings.redis_ca_file)
    return given
