"""The scripts behind :mod:`workers.ledger`: each is one step of a job, atomic inside the queue
server."""

from __future__ import annotations

from workers import admission, measures
from workers.keys import Keys
from workers.lua import filled

LONGEST_KEPT_REQUEST = 8 * 1024
"""Bytes of a request that stays in the record of an ended job, so that a recipe can be made of
it."""

ENDED_MS = 15_000
"""How long the end of a job is signalled: longer than anybody waits for it without looking at the
record."""

_LIBRARY = """
local id, keep_ms, tombstone_ms = ARGV[1], tonumber(ARGV[2]), tonumber(ARGV[3])
local max_attempts, too_late, worker_lost = tonumber(ARGV[4]), ARGV[5], ARGV[6]
local job, alive, events = '@job@' .. id, '@alive@' .. id, '@events@' .. id
local time = redis.call('TIME')
local now = tonumber(time[1]) + tonumber(time[2]) / 1e6

local known = {} -- fields of the record that were read, until they are written
local function get(field)
  if known[field] == nil then known[field] = redis.call('HGET', job, field) end
  return known[field]
end
local function set(...)
  redis.call('HSET', job, ...)
  for k = 1, select('#', ...), 2 do known[select(k, ...)] = nil end
end
local function unset(field)
  redis.call('HDEL', job, field)
  known[field] = nil
end
local function text(seconds) return string.format('%.6f', seconds) end
local function waiting() return '@waiting@' .. get('priority') end

local function tell()
  redis.call('XADD', events, 'MAXLEN', '~', 500, '*', 'state', get('state'), 'progress', get('progress'))
end

local function count(state) redis.call('HINCRBY', '@counts@', get('kind') .. '|' .. state, 1) end
"""

_ENDS = """
local function measure(state)
  local kind, owner, started = get('kind'), get('owner') or '', get('started_at')
  add('owner|' .. owner .. '|' .. state, 1)
  if state == 'failed' then add('failed|' .. kind .. '|' .. cjson.decode(get('problem')).code, 1) end
  if get('state') ~= 'running' then return end
  observe('run|' .. kind .. '|' .. state, now - tonumber(started))
  redis.call('HINCRBYFLOAT', '@measures@', 'owner_seconds|' .. owner, text(math.max(now - tonumber(started), 0)))
  for stage, ms in pairs(cjson.decode(get('timings_ms') or '{}')) do
    if stage ~= 'queue_wait' and stage ~= 'total' then observe('stage|' .. kind .. '|' .. stage, ms / 1000) end
  end
end

local function conclude(state)
  count(state)
  measure(state)
  unset('request_blob')
  if #(get('request') or '') > @longest_kept@ then unset('request') end
  redis.call('SREM', '@owned@' .. (get('owner') or ''), id)
  set('state', state, 'ended_at', text(now), 'expires_at', text(now + keep_ms / 1000))
  withdraw()
  redis.call('ZREM', waiting(), id)
  redis.call('SREM', '@active@', id)
  redis.call('DEL', alive)
  redis.call('SET', '@tombstone@' .. id, '', 'PX', keep_ms + tombstone_ms)
  if get('webhook_url') then redis.call('ZADD', '@webhooks@', text(now), id) end
  tell()
  redis.call('PEXPIRE', job, keep_ms)
  redis.call('PEXPIRE', events, keep_ms)
  redis.call('XADD', '@ended@' .. id, '*', 'state', state)
  redis.call('PEXPIRE', '@ended@' .. id, @ended_ms@)
end

local function fail(problem)
  set('problem', problem)
  conclude('failed')
end

local function requeue()
  set('state', 'queued')
  unset('silent_since')
  redis.call('DEL', alive)
  redis.call('ZADD', waiting(), get('created_at'), id)
  put_back()
  tell()
end

local function lost()
  if now > tonumber(get('deadline')) or tonumber(get('attempts')) >= max_attempts then
    fail(worker_lost)
    return 'failed'
  end
  add('retried|' .. get('kind'), 1)
  requeue()
  return 'requeued'
end

local function moved_by(seconds)
  set('deadline', text(tonumber(get('deadline')) + seconds))
  add('preempted|' .. get('kind'), 1)
end

-- A paused job that holds the lock of the networks would keep the one out for which it was paused.
local function is_in_the_way()
  if get('priority') ~= 'batch' or get('kind') == 'import_network' then return false end
  return redis.call('ZCARD', '@waiting@interactive') > 0
end

local function mine(attempt) return get('state') == 'running' and get('attempts') == attempt end
"""

_STEPS = {
    "admit": """
return admission(7) or false
""",
    "open": """
if get('state') then return false end -- the answer to an earlier try was lost
local verdict = admission(7)
if verdict then return verdict end
if ARGV[7] ~= '' then redis.call('SET', ARGV[7], ARGV[12] .. ' ' .. id, 'PX', ARGV[13]) end
local kind, priority, label, timeout_s, request = ARGV[14], ARGV[15], ARGV[16], tonumber(ARGV[17]), ARGV[18]
local names = {[8] = 'owner', [19] = 'webhook_url', [20] = 'request_blob', [21] = 'request_id', [22] = 'traceparent',
               [23] = 'recipe'}
for place, field in pairs(names) do
  if ARGV[place] ~= '' then set(field, ARGV[place]) end
end
set('id', id, 'kind', kind, 'priority', priority, 'label', label, 'request', request, 'state', 'queued',
    'progress', '0', 'attempts', '0', 'created_at', text(now), 'deadline', text(now + timeout_s))
redis.call('SADD', '@active@', id)
redis.call('SADD', '@owned@' .. ARGV[8], id)
redis.call('ZADD', waiting(), text(now), id)
redis.call('ZADD', '@recent@', redis.call('INCR', '@recent@:number'), id)
count('queued')
tell()
put(24)
return false
""",
    "claim": """
if get('state') ~= 'queued' then return false end
take()
if now > tonumber(get('deadline')) then fail(too_late); return false end
redis.call('ZREM', waiting(), id)
set('attempts', get('attempts') + 1)
unset('silent_since')
redis.call('SET', alive, ARGV[7], 'PX', ARGV[8])
set('state', 'running', 'started_at', text(now), 'progress', '0')
tell()
local waited = now - tonumber(get('created_at'))
observe('wait|' .. get('priority'), waited)
return {get('attempts'), get('request'), text(tonumber(get('deadline')) - now), text(waited),
        get('request_blob') or '', get('request_id') or '', get('traceparent') or '', get('owner') or ''}
""",
    "renew": """
local state = get('state')
if mine(ARGV[7]) then
  redis.call('SET', alive, ARGV[8], 'PX', ARGV[9])
  local stood_s = tonumber(ARGV[10])
  if stood_s > 0 then moved_by(stood_s) end
  return is_in_the_way() and 'wanted' or 'held'
end
return get('attempts') == ARGV[7] and (state == 'succeeded' or state == 'failed') and 'ended' or 'gone'
""",
    "progress": """
if mine(ARGV[7]) then set('progress', ARGV[8]); tell() end
""",
    "end": """
local attempt, state = ARGV[7], ARGV[8]
if attempt == '' then
  if get('state') ~= 'queued' then return 0 end
elseif not mine(attempt) then
  return 0
end
set(unpack(ARGV, 9))
conclude(state)
return 1
""",
    "cancel": """
local state = get('state')
if state == 'queued' or state == 'running' then conclude('cancelled') end
""",
    "lost": """
if not mine(ARGV[7]) then return false end
return lost()
""",
    "reap": """
local state = get('state')
if state ~= 'queued' and state ~= 'running' then redis.call('SREM', '@active@', id); return false end
if state == 'queued' and now > tonumber(get('deadline')) then fail(too_late); return 'too late' end

local in_queue = state == 'queued' and has_place()
if in_queue or redis.call('EXISTS', alive) == 1 then
  unset('silent_since')
  return false
end
local since = get('silent_since')
if not since then set('silent_since', text(now)); return false end
if now - tonumber(since) < tonumber(ARGV[7]) / 1000 then return false end

if state == 'queued' then requeue(); return 'requeued' end
return lost()
""",
}


def scripts(keys: Keys, dispatch: str) -> dict[str, str]:
    """By the name of the step; ``dispatch`` is the script of :class:`workers.dispatch.Dispatch`."""
    names = {
        "job": keys.job(""),
        "alive": keys.alive(""),
        "events": keys.events(""),
        "tombstone": keys.tombstone(""),
        "owned": keys.owned(""),
        "waiting": keys.waiting(""),
        "active": keys.active,
        "recent": keys.recent,
        "counts": keys.counts,
        "webhooks": keys.webhooks,
        "measures": keys.measures,
        "longest_kept": str(LONGEST_KEPT_REQUEST),
        "ended": keys.ended(""),
        "ended_ms": str(ENDED_MS),
    }
    parts = (
        filled(_LIBRARY, **names),
        dispatch,
        measures.script(keys),
        admission.script(keys),
        filled(_ENDS, **names),
    )
    library = "".join(parts)
    return {name: library + filled(body, **names) for name, body in _STEPS.items()}
