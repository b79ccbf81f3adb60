"""Whether a job may enter: once an idempotency key, and while there is room; asked where its record
is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace

from workers.dispatch import Argument
from workers.errors import IdempotencyConflict, QueueFull
from workers.keys import Keys
from workers.lua import filled
from workers.record import ALL_QUEUES

_RETRY_AFTER_S = 5.0

LUA = """
local function admission(first)
  local key, owner = ARGV[first], ARGV[first + 1]
  local max_depth, max_bytes, most_jobs = unpack(ARGV, first + 2, first + 4)
  local known = key ~= '' and redis.call('GET', key)
  if known then return {'known', known} end
  if max_depth == '' then return end
  local waits = 0
  for _, queue in ipairs({@queues@}) do waits = waits + redis.call('ZCARD', '@waiting@' .. queue) end
  if waits >= tonumber(max_depth) then return {'refused', 'too many jobs wait'} end
  local taken = string.match(redis.call('INFO', 'memory'), 'used_memory:(%d+)')
  if tonumber(taken) >= tonumber(max_bytes) then
    return {'refused', 'the queue server holds as much as it may'}
  end
  local owned = redis.call('SCARD', '@owned@' .. owner)
  if most_jobs ~= '' and owned >= tonumber(most_jobs) then
    return {'refused', 'this key has ' .. owned .. ' jobs under way, as many as it may'}
  end
end
"""
"""``admission(first)``: why a job does not enter by the terms from ARGV[first] on, nil if it
does."""


def script(keys: Keys) -> str:
    """:data:`LUA` for the keys of a deployment."""
    queues = ", ".join(f"'{name}'" for name in ALL_QUEUES)
    return filled(LUA, queues=queues, waiting=keys.waiting(""), owned=keys.owned(""))


@dataclass(frozen=True)
class Terms:
    """On which a job may enter."""

    max_depth: int
    max_bytes: int
    """Of the memory of the queue server."""
    owner: str = ""
    most_jobs: int | None = None
    """Of the owner, under way."""
    key: str = ""
    """Of the queue server, for the idempotency key; empty without one."""
    digest: str = ""
    """Of the request: a key stands for one request."""
    has_room: bool = False
    """It is known that there is room."""

    def arguments(self) -> list[Argument]:
        """Of :data:`LUA`."""
        most = "" if self.most_jobs is None else self.most_jobs
        return [self.key, self.owner, "" if self.has_room else self.max_depth, self.max_bytes, most]

    def with_room(self) -> Terms:
        """These, once it is known that there is room."""
        return replace(self, has_room=True)

    def known_job(self, verdict: list[str] | None) -> str | None:
        """The job that the key stands for, None if a job of its own enters; raises QueueFull,
        IdempotencyConflict."""
        if verdict is None:
            return None
        what, text = verdict
        if what == "refused":
            raise QueueFull(text, _RETRY_AFTER_S)
        known_digest, job_id = text.rsplit(" ", 1)
        if known_digest != self.digest:
            raise IdempotencyConflict("the Idempotency-Key was used for another request")
        return job_id
