"""Webhooks that were given up: kept for a week, for an operator to look at and to send again."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, cast

import redis

from workers.keys import Keys

_KEPT_S = 7 * 86_400
_MOST = 1000


@dataclass(frozen=True)
class DeadLetter:
    """``attempts`` since it was last sent again; ``given_up_at`` in seconds since the epoch."""

    job_id: str
    url: str
    body: str
    error: str
    given_up_at: float
    attempts: int


class DeadLetters:
    """The dead letters, over one client of the queue server."""

    def __init__(self, client: redis.Redis, keys: Keys) -> None:
        self._client = client
        self._keys = keys

    def bury(self, job_id: str, url: str, body: str, error: str) -> None:
        """Keep a webhook that was given up; the oldest go when there are too many."""
        now = time.time()
        letter: dict[Any, str] = {
            "url": url,
            "body": body,
            "error": error,
            "given_up_at": repr(now),
        }
        with self._client.pipeline() as pipeline:
            pipeline.delete(self._keys.dead_letter(job_id))
            pipeline.hset(self._keys.dead_letter(job_id), mapping=letter)
            pipeline.expire(self._keys.dead_letter(job_id), _KEPT_S)
            pipeline.zadd(self._keys.dead_letters, {job_id: now})
            pipeline.zremrangebyscore(self._keys.dead_letters, "-inf", now - _KEPT_S)
            pipeline.zrange(self._keys.dead_letters, 0, -_MOST - 1)
            *_, oldest = pipeline.execute()
        for old in oldest:
            self.forget(old)

    def get(self, job_id: str) -> DeadLetter | None:
        """The dead letter of a job, if it is one and still kept."""
        fields = cast(dict[str, str], self._client.hgetall(self._keys.dead_letter(job_id)))
        if "url" not in fields:
            return None
        return DeadLetter(
            job_id=job_id,
            url=fields["url"],
            body=fields["body"],
            error=fields["error"],
            given_up_at=float(fields["given_up_at"]),
            attempts=int(fields.get("webhook_attempts", 0)),
        )

    def all(self) -> list[DeadLetter]:
        """Newest first."""
        letters = (
            self.get(job_id)
            for job_id in cast(list[str], self._client.zrevrange(self._keys.dead_letters, 0, _MOST))
        )
        return [letter for letter in letters if letter is not None]

    def resend(self, job_id: str) -> bool:
        """Have it delivered anew, all its attempts; False if it is not kept."""
        if self.get(job_id) is None:
            return False
        self._client.zadd(self._keys.webhooks, {job_id: 0})
        return True

    def forget(self, job_id: str) -> None:
        self._client.delete(self._keys.dead_letter(job_id))
        self._client.zrem(self._keys.dead_letters, job_id)
