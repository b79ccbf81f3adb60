"""Tracks in the queue server: one hash a track, which expires, so that any replica answers its next
frame.

Strategy: a frame needs the state after the one before it. Who answers a frame holds the track
meanwhile, by a key that expires should its process die; the state is written only by who still
holds it. A set of all tracks by the time they expire bounds how many there are.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable
from dataclasses import dataclass
from typing import cast
from uuid import uuid4

import redis.asyncio

from workers.connection import connect_async
from workers.errors import TrackBusy, TracksFull, TrackUnknown
from workers.settings import Settings

_LOOK_EVERY_S = 0.01
_RETRY_AFTER_S = 5.0

_OPEN = """
local most, ttl, now = tonumber(ARGV[1]), tonumber(ARGV[2]), redis.call('TIME')
now = tonumber(now[1]) + tonumber(now[2]) / 1e6
redis.call('ZREMRANGEBYSCORE', KEYS[2], '-inf', now)
if redis.call('ZCARD', KEYS[2]) >= most then return 0 end
redis.call('ZADD', KEYS[2], now + ttl, ARGV[3])
redis.call('HSET', KEYS[1], 'owner', ARGV[4], 'options', ARGV[5], 'state', '', 'frames', '0', 'cables', '0',
           'created_at', string.format('%.3f', now), 'expires_at', string.format('%.3f', now + ttl))
redis.call('PEXPIRE', KEYS[1], math.floor(ttl * 1000))
return 1
"""
_STORE = """
local ttl, now = tonumber(ARGV[1]), redis.call('TIME')
now = tonumber(now[1]) + tonumber(now[2]) / 1e6
if redis.call('GET', KEYS[2]) ~= ARGV[2] or redis.call('EXISTS', KEYS[1]) == 0 then return 0 end
redis.call('HSET', KEYS[1], 'state', ARGV[4], 'frames', ARGV[5], 'cables', ARGV[6],
           'expires_at', string.format('%.3f', now + ttl))
redis.call('PEXPIRE', KEYS[1], math.floor(ttl * 1000))
redis.call('ZADD', KEYS[3], now + ttl, ARGV[3])
return 1
"""
_RELEASE = "if redis.call('GET', KEYS[1]) == ARGV[1] then redis.call('DEL', KEYS[1]) end"


@dataclass(frozen=True)
class TrackRecord:
    """A track as it is kept; ``options`` and ``state`` are JSON, ``state`` empty before the first
    frame; times are seconds since the epoch."""

    id: str
    owner: str
    options: str
    state: str
    frames: int
    cables: int
    created_at: float
    expires_at: float


class Tracks:
    """Every method raises ``redis.RedisError`` when the queue server does not answer."""

    def __init__(self, settings: Settings, client: redis.asyncio.Redis | None = None) -> None:
        self._settings, self._keys = settings, settings.keys
        self._client = client or connect_async(settings)
        self._open = self._client.register_script(_OPEN)
        self._store = self._client.register_script(_STORE)
        self._release = self._client.register_script(_RELEASE)

    async def open(self, options: str, owner: str) -> TrackRecord:
        """Begin a track; raises TracksFull."""
        track_id = uuid4().hex
        settings = self._settings
        arguments: list[str | float] = [
            settings.max_tracks,
            settings.track_ttl_s,
            track_id,
            owner,
            options,
        ]
        if not await self._open(
            keys=[self._keys.track(track_id), self._keys.tracks], args=arguments
        ):
            raise TracksFull("as many tracks as there may be", _RETRY_AFTER_S)
        return await self.get(track_id)

    async def get(self, track_id: str) -> TrackRecord:
        """Raises TrackUnknown, also for one that has expired."""
        fields = await cast(
            Awaitable[dict[str, str]], self._client.hgetall(self._keys.track(track_id))
        )
        if not fields:
            raise TrackUnknown(track_id)
        return TrackRecord(
            track_id,
            fields["owner"],
            fields["options"],
            fields["state"],
            int(fields["frames"]),
            int(fields["cables"]),
            float(fields["created_at"]),
            float(fields["expires_at"]),
        )

    async def hold(self, track_id: str, for_s: float, wait_s: float) -> str:
        """Take the track for one frame, for at most ``for_s`` seconds; what :meth:`store` and
        :meth:`release` want. Raises TrackBusy if another frame has it for more than ``wait_s``
        seconds."""
        token, give_up = uuid4().hex, time.monotonic() + wait_s
        while not await self._client.set(
            self._keys.track_held(track_id), token, nx=True, px=round(for_s * 1000)
        ):
            if time.monotonic() > give_up:
                raise TrackBusy(track_id)
            await asyncio.sleep(_LOOK_EVERY_S)
        return token

    async def store(self, track_id: str, token: str, state: str, frames: int, cables: int) -> None:
        """The state after a frame. Raises TrackUnknown if the track is gone or no longer held."""
        keys = [self._keys.track(track_id), self._keys.track_held(track_id), self._keys.tracks]
        ttl_s = self._settings.track_ttl_s
        if not await self._store(keys=keys, args=[ttl_s, token, track_id, state, frames, cables]):
            raise TrackUnknown(track_id)

    async def release(self, track_id: str, token: str) -> None:
        await self._release(keys=[self._keys.track_held(track_id)], args=[token])

    async def drop(self, track_id: str) -> None:
        """Forget the track; nothing happens to one that is not there."""
        keys = self._keys.track(track_id), self._keys.track_held(track_id)
        await self._client.delete(*keys)
        await self._client.zrem(self._keys.tracks, track_id)

    async def close(self) -> None:
        await self._client.aclose()
