"""The states of a job and the only steps between them.

Strategy: each step is one script inside the queue server, hence atomic: it looks at the state (and, for a
running job, at the number of the attempt), and does nothing unless the step is allowed from there. So of
two that race — a cancel and a success, a reaper and a slow worker — the first wins and the other is told.

    queued ──claim──► running ──end──► succeeded | failed | cancelled
      ▲                  │
      └── lost, reap ────┘            queued ──end──► failed (too late, refused) | cancelled

The scripts name keys that are not declared to the server: a Redis cluster is not supported.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, cast

import redis
from dlo_client.contracts import Contract, FileRef, JobState, Problem
from rq.job import Job as RQJob
from rq.queue import Queue

from workers import problems
from workers.record import (
    ACTIVE,
    COUNTS,
    RECENT,
    WEBHOOKS,
    Entry,
    alive_key,
    events_key,
    job_key,
    owned_key,
    tombstone_key,
)
from workers.settings import Settings

ALIVE_MS = 5000
"""A running job whose worker is silent for so long is taken for lost …"""

GRACE_MS = 1500
"""… if it is still silent so much later: right after a restart of the queue server all of them are."""

_LIBRARY = f"""
local id, keep_ms, tombstone_ms = ARGV[1], tonumber(ARGV[2]), tonumber(ARGV[3])
local max_attempts, too_late, worker_lost = tonumber(ARGV[4]), ARGV[5], ARGV[6]
local job, alive, events = '{job_key("")}' .. id, '{alive_key("")}' .. id, '{events_key("")}' .. id
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6

local function get(field) return redis.call('HGET', job, field) end
local function set(...) redis.call('HSET', job, ...) end
local function text(seconds) return string.format('%.6f', seconds) end
local function queue() return '{Queue.redis_queue_namespace_prefix}' .. get('priority') end

local function tell()
  redis.call('XADD', events, 'MAXLEN', '~', 500, '*', 'state', get('state'), 'progress', get('progress'))
end

local function count(state) redis.call('HINCRBY', '{COUNTS}', get('kind') .. '|' .. state, 1) end

local function conclude(state)
  count(state)
  redis.call('HDEL', job, 'request', 'request_blob')
  redis.call('SREM', '{owned_key("")}' .. (get('owner') or ''), id)
  set('state', state, 'ended_at', text(now), 'expires_at', text(now + keep_ms / 1000))
  redis.call('LREM', queue(), 0, id)
  redis.call('SREM', '{ACTIVE}', id)
  redis.call('DEL', alive, '{RQJob.redis_job_namespace_prefix}' .. id)
  redis.call('SET', '{tombstone_key("")}' .. id, '', 'PX', keep_ms + tombstone_ms)
  if get('webhook_url') then redis.call('ZADD', '{WEBHOOKS}', text(now), id) end
  tell()
  redis.call('PEXPIRE', job, keep_ms)
  redis.call('PEXPIRE', events, keep_ms)
end

local function fail(problem)
  set('problem', problem)
  conclude('failed')
end

local function requeue()
  set('state', 'queued')
  redis.call('HDEL', job, 'silent_since')
  redis.call('DEL', alive)
  redis.call('LPUSH', queue(), id)
  tell()
end

local function lost()
  if now > tonumber(get('deadline')) or tonumber(get('attempts')) >= max_attempts then
    fail(worker_lost)
    return 'failed'
  end
  requeue()
  return 'requeued'
end

local function mine(attempt) return get('state') == 'running' and get('attempts') == attempt end
"""

_OPEN = f"""
local kind, priority, label, timeout_s, request = ARGV[7], ARGV[8], ARGV[9], tonumber(ARGV[10]), ARGV[11]
for place, field in pairs({{[12] = 'webhook_url', [13] = 'request_blob', [14] = 'owner'}}) do
  if ARGV[place] ~= '' then set(field, ARGV[place]) end
end
set('id', id, 'kind', kind, 'priority', priority, 'label', label, 'request', request, 'state', 'queued',
    'progress', '0', 'attempts', '0', 'created_at', text(now), 'deadline', text(now + timeout_s))
redis.call('SADD', '{ACTIVE}', id)
redis.call('SADD', '{owned_key("")}' .. ARGV[14], id)
redis.call('ZADD', '{RECENT}', redis.call('INCR', '{RECENT}:number'), id)
count('queued')
tell()
"""

_CLAIM = """
if get('state') ~= 'queued' then return false end
if now > tonumber(get('deadline')) then fail(too_late); return false end
redis.call('HINCRBY', job, 'attempts', 1)
redis.call('HDEL', job, 'silent_since')
redis.call('SET', alive, ARGV[7], 'PX', ARGV[8])
set('state', 'running', 'started_at', text(now), 'progress', '0')
tell()
return {get('attempts'), get('request'), text(tonumber(get('deadline')) - now),
        text(now - tonumber(get('created_at'))), get('request_blob') or ''}
"""

_RENEW = """
if not mine(ARGV[7]) then return 0 end
redis.call('SET', alive, ARGV[8], 'PX', ARGV[9])
return 1
"""

_PROGRESS = """
if mine(ARGV[7]) then set('progress', ARGV[8]); tell() end
"""

_END = """
local attempt, state = ARGV[7], ARGV[8]
if attempt == '' then
  if get('state') ~= 'queued' then return 0 end
elseif not mine(attempt) then
  return 0
end
set(unpack(ARGV, 9))
conclude(state)
return 1
"""

_CANCEL = """
local state = get('state')
if state == 'queued' or state == 'running' then conclude('cancelled') end
"""

_LOST = """
if not mine(ARGV[7]) then return false end
return lost()
"""

_REAP = f"""
local state = get('state')
if state ~= 'queued' and state ~= 'running' then redis.call('SREM', '{ACTIVE}', id); return false end
if state == 'queued' and now > tonumber(get('deadline')) then fail(too_late); return 'too late' end

local in_queue = state == 'queued' and redis.call('LPOS', queue(), id)
if in_queue or redis.call('EXISTS', alive) == 1 then
  redis.call('HDEL', job, 'silent_since')
  return false
end
local since = get('silent_since')
if not since then set('silent_since', text(now)); return false end
if now - tonumber(since) < tonumber(ARGV[7]) / 1000 then return false end

if state == 'queued' then requeue(); return 'requeued' end
return lost()
"""


@dataclass(frozen=True)
class Claim:
    """The right to run a job once: held until the job's ``attempt`` is over or another began."""

    job_id: str
    attempt: int
    request: str
    """JSON of the request, if it is not in a blob."""
    remaining_s: float
    """Until the deadline, when the claim was made."""
    queue_wait_ms: float
    request_blob: str = ""
    """Id of the blob with the JSON of a large request."""


class Ledger:
    """The steps of a job's record, over one client of the queue server."""

    def __init__(self, client: redis.Redis, settings: Settings) -> None:
        self._client = client
        self._settings_arguments = (
            round(settings.result_ttl_s * 1000),
            round(settings.tombstone_ttl_s * 1000),
            settings.max_attempts,
            problems.deadline_exceeded().model_dump_json(),
            problems.worker_lost().model_dump_json(),
        )
        steps = {"open": _OPEN, "claim": _CLAIM, "renew": _RENEW, "progress": _PROGRESS}
        steps |= {"end": _END, "cancel": _CANCEL, "lost": _LOST, "reap": _REAP}
        self._scripts = {name: client.register_script(_LIBRARY + body) for name, body in steps.items()}

    def open(
        self, pipeline: redis.client.Pipeline, job_id: str, entry: Entry, *, request_blob: str = "", owner: str = ""
    ) -> None:
        """Begin a record, as part of the transaction that also puts the id into a queue.

        The request is in the blob ``request_blob`` if there is one, else in the record.
        """
        texts = (entry.kind, entry.priority, entry.label or "")
        request = "" if request_blob else entry.request
        more = (entry.timeout_s, request, entry.webhook_url or "", request_blob, owner)
        self._step("open", job_id, *texts, *more, client=pipeline)

    def claim(self, job_id: str, worker: str) -> Claim | None:
        """Make a queued job running; None if it is not queued, or too late (it then has failed)."""
        answer = self._step("claim", job_id, worker, ALIVE_MS)
        if answer is None:
            return None
        attempt, request, remaining_s, waited_s, blob_id = answer
        return Claim(job_id, int(attempt), request, float(remaining_s), float(waited_s) * 1000, blob_id)

    def renew(self, claim: Claim, worker: str) -> bool:
        """Say that the job is still being worked on; False if the claim is no longer held."""
        return bool(self._step("renew", claim.job_id, claim.attempt, worker, ALIVE_MS))

    def progress(self, claim: Claim, fraction: float) -> None:
        self._step("progress", claim.job_id, claim.attempt, f"{fraction:.4f}")

    def succeed(self, claim: Claim, result: Contract, files: list[FileRef], timings_ms: dict[str, float]) -> bool:
        """End a job well; False if the claim is no longer held, and nothing has changed."""
        fields = {
            "result": result.model_dump_json(),
            "files": json.dumps([file.model_dump() for file in files]),
            "timings_ms": json.dumps(timings_ms),
            "progress": "1",
        }
        return self._end(claim.job_id, claim.attempt, JobState.SUCCEEDED, fields)

    def fail(self, claim: Claim, problem: Problem) -> bool:
        """End a job badly; False if the claim is no longer held, and nothing has changed."""
        return self._end(claim.job_id, claim.attempt, JobState.FAILED, {"problem": problem.model_dump_json()})

    def fail_queued(self, job_id: str, problem: Problem) -> bool:
        """End a job that never ran."""
        return self._end(job_id, "", JobState.FAILED, {"problem": problem.model_dump_json()})

    def cancel(self, job_id: str) -> None:
        """Cancel, unless the job is over; its worker sees that its claim is gone and stops."""
        self._step("cancel", job_id)

    def lost(self, claim: Claim) -> str | None:
        """The worker's child died: try the job again, or fail it. Says which; None if the claim was gone."""
        return cast(str | None, self._step("lost", claim.job_id, claim.attempt))

    def reap(self, job_id: str) -> str | None:
        """Put right what nobody works on any more; says what was done, if anything."""
        return cast(str | None, self._step("reap", job_id, GRACE_MS))

    def _end(self, job_id: str, attempt: int | str, state: JobState, fields: dict[str, str]) -> bool:
        pairs = [part for pair in fields.items() for part in pair]
        return bool(self._step("end", job_id, attempt, state.value, *pairs))

    def _step(
        self, name: str, job_id: str, *arguments: str | float, client: redis.client.Pipeline | None = None
    ) -> Any:
        return self._scripts[name](args=[job_id, *self._settings_arguments, *arguments], client=client)
