"""Tells the address that a request named when its job has ended: signed, and again until it is heard.

Strategy: the script that ends a job also puts its id into :data:`workers.record.WEBHOOKS`, with the time as
score. Any worker may call :meth:`Courier.deliver`: it takes what is due and in the same step moves it on by
a lease, so that of two couriers one delivers, and a courier that dies is followed by another. Delivery is at
least once; a receiver tells repeats by the header ``DLO-Job``.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from collections.abc import Callable
from typing import cast

import httpx
import redis
import structlog

from workers.record import WEBHOOKS, job_key, read_job
from workers.settings import Settings

DELAYS_S = (2.0, 10.0, 60.0, 300.0, 900.0)
"""After the first attempt fails, the second …; then it is given up. All within a job's default lifetime."""

INTERVAL_S = 1.0
_TIMEOUT_S = 5.0
_LEASE_MS = 60_000
_AT_ONCE = 20

_TAKE = f"""
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6
local due = redis.call('ZRANGEBYSCORE', '{WEBHOOKS}', '-inf', now, 'LIMIT', 0, 1)
if #due == 0 then return false end
redis.call('ZADD', '{WEBHOOKS}', now + tonumber(ARGV[1]) / 1000, due[1])
return due[1]
"""

_LATER = f"""
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6
redis.call('ZADD', '{WEBHOOKS}', 'XX', now + tonumber(ARGV[2]), ARGV[1])
"""

log = structlog.get_logger(__name__)


def signature(secret: str, timestamp: int, body: bytes) -> str:
    """The header ``DLO-Signature``: HMAC-SHA256 of ``timestamp.body`` in hex, and the timestamp it covers."""
    digest = hmac.new(secret.encode(), f"{timestamp}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={timestamp},v1={digest}"


class Courier:
    """Delivers over one client of the queue server; ``clock`` gives seconds since the epoch."""

    def __init__(self, client: redis.Redis, settings: Settings, clock: Callable[[], float] = time.time) -> None:
        self._client = client
        self._secret = settings.webhook_secret
        self._clock = clock
        self._take = client.register_script(_TAKE)
        self._later = client.register_script(_LATER)

    def deliver(self) -> int:
        """Try what is due, at most 20; returns how many were heard."""
        heard = 0
        for _ in range(_AT_ONCE):
            job_id = cast(str | None, self._take(args=[_LEASE_MS]))
            if job_id is None:
                break
            heard += self._try(job_id)
        return heard

    def _try(self, job_id: str) -> bool:
        key = job_key(job_id)
        record = cast(dict[str, str], self._client.hgetall(key))
        if not record:
            self._client.zrem(WEBHOOKS, job_id)
            return False
        attempt = int(record.get("webhook_attempts", 0)) + 1
        error = self._post(record, attempt)
        say = log.bind(job_id=job_id, attempt=attempt)
        if error is None or attempt > len(DELAYS_S):
            self._client.zrem(WEBHOOKS, job_id)
            say.info("webhook heard") if error is None else say.error("webhook given up", error=error)
            return error is None
        say.warning("webhook not heard", error=error)
        if self._client.exists(key):  # it may have expired meanwhile: do not leave a record without an end
            self._client.hset(key, "webhook_attempts", str(attempt))
        self._later(args=[job_id, DELAYS_S[attempt - 1]])
        return False

    def _post(self, record: dict[str, str], attempt: int) -> str | None:
        """None when the receiver answered 2xx; redirects are not followed: they could lead anywhere."""
        body = read_job(record).model_dump_json().encode()
        headers = {
            "Content-Type": "application/json",
            "DLO-Job": record["id"],
            "DLO-Attempt": str(attempt),
            "DLO-Signature": signature(self._secret, int(self._clock()), body),
        }
        try:
            reply = httpx.post(record["webhook_url"], content=body, headers=headers, timeout=_TIMEOUT_S)
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            return f"{type(error).__name__}: {error}"
        return None if reply.is_success else f"answered {reply.status_code}"
