"""What an owner may take: requests a minute, and bytes of pictures that are kept."""

from __future__ import annotations

from collections.abc import Mapping

PACE = """
local each, now = 60 / tonumber(ARGV[1]), redis.call('TIME')
now = tonumber(now[1]) + tonumber(now[2]) / 1e6
local next = math.max(now, tonumber(redis.call('GET', KEYS[1]) or 0))
if next - now > 60 - each then return tostring(next - now - 60 + each) end
redis.call('SET', KEYS[1], string.format('%.6f', next + each), 'EX', 61)
return '0'
"""
"""Seconds to wait, 0 if there is no need: in no minute more than ARGV[1] requests of the owner of
KEYS[1]."""

CHARGE = """
local most, ttl, now = tonumber(ARGV[1]), tonumber(ARGV[2]), redis.call('TIME')
now = tonumber(now[1]) + tonumber(now[2]) / 1e6
for _, gone in ipairs(redis.call('ZRANGEBYSCORE', KEYS[1], '-inf', now - ttl)) do
  redis.call('ZREM', KEYS[1], gone)
  redis.call('HDEL', KEYS[2], gone)
end
local total = 0
for _, size in ipairs(redis.call('HVALS', KEYS[2])) do total = total + tonumber(size) end
for place = 3, #ARGV, 2 do
  if redis.call('HEXISTS', KEYS[2], ARGV[place]) == 0 then total = total + tonumber(ARGV[place + 1]) end
end
if total > most then return 0 end
for place = 3, #ARGV, 2 do
  redis.call('ZADD', KEYS[1], now, ARGV[place])
  redis.call('HSET', KEYS[2], ARGV[place], ARGV[place + 1])
end
redis.call('EXPIRE', KEYS[1], ttl)
redis.call('EXPIRE', KEYS[2], ttl)
return 1
"""
"""1 if the blobs (id and size, from ARGV[3] on) fit into ARGV[1] bytes beside those of the last
ARGV[2] seconds."""


class QuotaExceededError(Exception):
    """The owner keeps as many bytes as it may."""


def charge_arguments(most: int, ttl_s: float, sizes: Mapping[str, int]) -> list[str | int | float]:
    """ARGV of :data:`CHARGE`."""
    return [most, round(ttl_s), *(part for pair in sizes.items() for part in pair)]
