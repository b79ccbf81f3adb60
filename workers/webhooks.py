"""Tells the address that a request named when its job has ended: signed, and again until it is
heard.

Strategy: the script that ends a job also puts its id into ``Keys.webhooks``, with the time as
score. Any worker may call :meth:`Courier.deliver`: it takes what is due and in the same step moves
it on by a lease, so that of two couriers one delivers, and a courier that dies is followed by
another. Many are under way at once, each with a deadline for the whole call, and few to one
receiver: a slow one holds up nobody else. What is never heard becomes a dead letter
(:mod:`workers.dead_letters`).

Delivery is at least once; a receiver tells repeats by ``webhook-id``. Headers and signature are
those of Standard Webhooks (standardwebhooks.com).
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast
from urllib.parse import urlsplit

import httpx
import redis
import structlog

from workers.dead_letters import DeadLetters
from workers.lua import filled
from workers.record import JobRecord
from workers.settings import Settings

DELAYS_S = (2.0, 10.0, 60.0, 300.0, 900.0)
"""After the first attempt fails, the second …; then it is given up. All within a job's default
lifetime."""

INTERVAL_S = 1.0
_DEADLINE_S = 5.0
_LEASE_MS = 60_000
_AT_ONCE = 20
_AT_ONCE_EACH = 4
_ROUND_S = 30.0
_LOOK_S = 0.2
_SECRET_PREFIX = "whsec_"

_TAKE = """
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6
local due = redis.call('ZRANGEBYSCORE', '@webhooks@', '-inf', now, 'LIMIT', 0, 1)
if #due == 0 then return false end
redis.call('ZADD', '@webhooks@', now + tonumber(ARGV[1]) / 1000, due[1])
return due[1]
"""

_LATER = """
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6
redis.call('ZADD', '@webhooks@', 'XX', now + tonumber(ARGV[2]), ARGV[1])
"""

log = structlog.get_logger(__name__)


def signed_headers(secret: str, job_id: str, timestamp: int, body: bytes) -> dict[str, str]:
    """``webhook-id``, ``-timestamp`` and ``-signature`` of a message."""
    signed = f"{job_id}.{timestamp}.".encode() + body
    digest = hmac.new(_key(secret), signed, hashlib.sha256).digest()
    signature = f"v1,{base64.b64encode(digest).decode()}"
    return {
        "webhook-id": job_id,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": signature,
    }


def _key(secret: str) -> bytes:
    """A secret as the standard writes it is base64 after a prefix; any other is taken as it
    stands."""
    if secret.startswith(_SECRET_PREFIX):
        return base64.b64decode(secret.removeprefix(_SECRET_PREFIX))
    return secret.encode()


@dataclass(frozen=True)
class _Message:
    url: str
    body: bytes
    attempt: int
    """From 1."""
    key: str
    """Of the hash that counts the attempts."""


class Courier:
    """Delivers over one client of the queue server; ``clock`` gives seconds since the epoch."""

    def __init__(
        self, client: redis.Redis, settings: Settings, clock: Callable[[], float] = time.time
    ) -> None:
        self._client = client
        self._keys = settings.keys
        self._secret = settings.webhook_secret
        self._clock = clock
        self._take = client.register_script(filled(_TAKE, webhooks=self._keys.webhooks))
        self._later = client.register_script(filled(_LATER, webhooks=self._keys.webhooks))
        self._dead = DeadLetters(client, self._keys)
        self._under_way: Counter[str] = Counter()

    def deliver(self) -> int:
        """Try what is due now, and what becomes due meanwhile; returns how many were heard."""
        first = self._next()
        return asyncio.run(self._round(first)) if first else 0

    async def _round(self, first: str) -> int:
        heard, until = 0, time.monotonic() + _ROUND_S
        async with httpx.AsyncClient(timeout=_DEADLINE_S) as http:
            pending = {asyncio.create_task(self._try(http, first))}
            while pending:
                while (
                    len(pending) < _AT_ONCE
                    and time.monotonic() < until
                    and (job_id := self._next())
                ):
                    pending.add(asyncio.create_task(self._try(http, job_id)))
                done, pending = await asyncio.wait(
                    pending, timeout=_LOOK_S, return_when=asyncio.FIRST_COMPLETED
                )
                heard += sum(task.result() for task in done)
        return heard

    def _next(self) -> str | None:
        return cast(str | None, self._take(args=[_LEASE_MS]))

    async def _try(self, http: httpx.AsyncClient, job_id: str) -> bool:
        message = self._message(job_id)
        if message is None:
            self._client.zrem(self._keys.webhooks, job_id)
            return False
        receiver = urlsplit(message.url).netloc
        if self._under_way[receiver] >= _AT_ONCE_EACH:
            self._later(args=[job_id, INTERVAL_S])
            return False
        self._under_way[receiver] += 1
        try:
            error = await self._post(http, job_id, message)
        finally:
            self._under_way[receiver] -= 1
        self._conclude(job_id, message, error)
        return error is None

    def _message(self, job_id: str) -> _Message | None:
        """Of a dead letter that is sent again, else of the job; None if neither is kept any
        more."""
        if letter := self._dead.get(job_id):
            return _Message(
                letter.url,
                letter.body.encode(),
                letter.attempts + 1,
                self._keys.dead_letter(job_id),
            )
        record = cast(dict[str, str], self._client.hgetall(self._keys.job(job_id)))
        if not record:
            return None
        body = JobRecord.read(record).json().encode()
        return _Message(
            record["webhook_url"],
            body,
            int(record.get("webhook_attempts", 0)) + 1,
            self._keys.job(job_id),
        )

    async def _post(self, http: httpx.AsyncClient, job_id: str, message: _Message) -> str | None:
        """None when the receiver answered 2xx. Redirects could lead anywhere, and are not followed;
        what it answers beyond its status is not read."""
        headers = signed_headers(self._secret, job_id, int(self._clock()), message.body)
        headers |= {"Content-Type": "application/json", "DLO-Attempt": str(message.attempt)}
        try:
            async with (
                asyncio.timeout(_DEADLINE_S),
                http.stream("POST", message.url, content=message.body, headers=headers) as reply,
            ):
                return None if reply.is_success else f"answered {reply.status_code}"
        except TimeoutError:
            return f"no answer within {_DEADLINE_S:g} s"
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            return f"{type(error).__name__}: {error}"

    def _conclude(self, job_id: str, message: _Message, error: str | None) -> None:
        say = log.bind(job_id=job_id, attempt=message.attempt)
        if error is None:
            self._client.zrem(self._keys.webhooks, job_id)
            self._dead.forget(job_id)
            self._client.hincrby(self._keys.measures, "webhook|heard", 1)
            say.info("webhook heard")
        elif message.attempt > len(DELAYS_S):
            self._client.zrem(self._keys.webhooks, job_id)
            self._dead.bury(job_id, message.url, message.body.decode(), error)
            self._client.hincrby(self._keys.measures, "webhook|given_up", 1)
            say.error("webhook given up", error=error)
        else:
            self._client.hincrby(self._keys.measures, "webhook|not_heard", 1)
            say.warning("webhook not heard", error=error)
            if self._client.exists(
                message.key
            ):  # it may have expired meanwhile: leave no record without an end
                self._client.hset(message.key, "webhook_attempts", str(message.attempt))
            self._later(args=[job_id, DELAYS_S[message.attempt - 1]])
