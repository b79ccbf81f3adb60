"""How ids of queued jobs come to workers: RQ by default, behind a protocol that another engine can
fill.

Strategy: a job's record states how it stands; an engine only carries ids, and may lose one (the
reaper puts it back) or bring one twice (the claim refuses it). So little is asked of it: five
functions in Lua that the ledger's steps call inside the queue server, and what the first of them
needs to put an id into a queue. The other side, what brings ids to a worker, is
``workers.runner.Runner`` being called with them. RQ writes its entry itself: the commands that it
would send are recorded, and repeated inside the script that opens the record, in one trip to the
server.

Owners have equal shares of each queue, by start-time fair queueing (Goyal, Vin and Cheng, 1996): a
job's turn is one after the later of its owner's last turn and the turn of the job last taken; the
queue is kept in order of turns. An owner with a thousand waiting jobs delays another's first one by
one job.
"""

from __future__ import annotations

from typing import Protocol

import redis
from rq.job import Job
from rq.queue import Queue
from rq.serializers import JSONSerializer

from workers.keys import Keys
from workers.lua import filled
from workers.record import ALL_QUEUES, Priority

RUN = "workers.jobs.run"
"""The one function that a queue entry may name."""


Argument = str | float | bytes
"""Of a script."""


class Dispatch(Protocol):
    """The door's side of an engine."""

    script: str
    """Lua: ``put(first)`` into the queue, with ``arguments`` from ARGV[first] on, ``take()`` after
    a worker got the id, ``withdraw()``, ``put_back()`` to the front, ``has_place()``; each about
    the job ``id``, whose record ``get(field)`` reads."""

    def arguments(self, job_id: str, priority: Priority) -> list[Argument]:
        """What ``put`` needs for a job."""


_LUA = """
local function line() return '@line@' .. get('priority') end
local function turns() return '@turns@' .. get('priority') end

local function queue_up(first)
  while ARGV[first] do
    local last = first + tonumber(ARGV[first])
    redis.call(unpack(ARGV, first + 1, last))
    first = last + 1
  end
end

local function place()
  local line, turns, last, owner = line(), turns(), '@last@' .. get('priority'), get('owner') or ''
  if redis.call('EXISTS', turns) == 0 then redis.call('DEL', last) end
  local function turn_of(field) return tonumber(redis.call('HGET', last, field) or 0) end
  local turn = math.max(turn_of(owner), turn_of(' ')) + 1
  redis.call('HSET', last, owner, turn)
  for _, later in ipairs(redis.call('ZRANGEBYSCORE', turns, '(' .. turn, '+inf', 'LIMIT', 0, 20)) do
    redis.call('LREM', line, -1, id)
    if redis.call('LINSERT', line, 'BEFORE', later, id) > 0 then break end
    redis.call('RPUSH', line, id)
  end
  redis.call('ZADD', turns, turn, id)
end

local function put(first)
  queue_up(first)
  place()
end

local function take()
  local turn = redis.call('ZSCORE', turns(), id)
  if not turn then return end
  redis.call('ZREM', turns(), id)
  local last = '@last@' .. get('priority')
  if tonumber(turn) > tonumber(redis.call('HGET', last, ' ') or 0) then redis.call('HSET', last, ' ', turn) end
end

local function withdraw()
  redis.call('LREM', line(), 0, id)
  redis.call('ZREM', turns(), id)
  redis.call('DEL', '@entry@' .. id)
end

local function put_back()
  redis.call('LPUSH', line(), id)
  redis.call('ZADD', turns(), 0, id)
end

local function has_place() return redis.call('LPOS', line(), id) end
"""
"""``queue_up`` repeats RQ's commands, each as the number of its words and the words; ``place``
moves the id from the end of the queue, where RQ puts it, to its owner's turn."""


class RqDispatch:
    """RQ's queues, one a priority."""

    def __init__(self, client: redis.Redis, keys: Keys) -> None:
        self._client = client
        self._queues = {
            name: Queue(keys.queue(name), connection=client, serializer=JSONSerializer)
            for name in ALL_QUEUES
        }
        self.script = filled(
            _LUA,
            line=Queue.redis_queue_namespace_prefix + keys.queue(""),
            turns=keys.turns(""),
            last=keys.last_turns(""),
            entry=Job.redis_job_namespace_prefix,
        )

    def arguments(self, job_id: str, priority: Priority) -> list[Argument]:
        """See :class:`Dispatch`."""
        queue, recorded = self._queues[priority], self._client.pipeline()
        queue.enqueue_job(queue.create_job(RUN, args=(job_id,), job_id=job_id), pipeline=recorded)
        return [word for words, _ in recorded.command_stack for word in (len(words), *words)]
