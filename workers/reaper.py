"""Finds jobs that nobody works on: their worker was killed, or their id got lost on its way to
one."""

from __future__ import annotations

from typing import cast

import redis
import structlog

from workers.keys import Keys
from workers.ledger import Ledger
from workers.listing import trim

INTERVAL_S = 2.0
_LOCK_MS = 1000

log = structlog.get_logger(__name__)


def reap(client: redis.Redis, keys: Keys, ledger: Ledger) -> int:
    """Put right every abandoned job; return how many. To be called about every ``INTERVAL_S``.

    Any number of processes may call it: one pass a second is made.
    """
    if not client.set(keys.reaping, "", nx=True, px=_LOCK_MS):
        return 0
    trim(client, keys)
    done = 0
    for job_id in cast(set[str], client.smembers(keys.active)):
        if what := ledger.reap(job_id):
            log.warning("job reaped", job_id=job_id, what=what)
            done += 1
    return done
