"""Do the service and its workers see the same pictures? Those that do not would fail every job they
take.

Strategy: the place of the blobs holds a mark, an id that was made with it. The queue server knows
the mark of the place that counts: the service's, or, before one has started, that of the first
worker. A worker whose place has another mark, or none, or does not answer, does not join.
"""

from __future__ import annotations

import time
from typing import cast

import redis
import structlog

from workers.blobs import Blobs, BlobsUnreachableError
from workers.keys import Keys
from workers.presence import present

_LOOK_AGAIN_S = 1.0
_REMEMBERED_MS = 5000
_ONE = "give all of them one DLO_DATA_DIR, or one DLO_BLOBS_URL"

log = structlog.get_logger(__name__)


def claim(client: redis.Redis, keys: Keys, blobs: Blobs) -> None:
    """For a service, again and again: its place counts, unless ready workers share another one."""
    ours = blobs.mark(make=True)
    if client.set(keys.blobs, ours or "", nx=True) or client.get(keys.blobs) == ours:
        return
    if not any(worker.ready for worker in present(client, keys)):
        client.set(keys.blobs, ours or "")


def apart(client: redis.Redis, keys: Keys, blobs: Blobs) -> str | None:
    """Why a process with this place cannot exchange pictures with the others; None if it can."""
    known = cast(str | None, client.get(keys.blobs))
    try:
        if known is None or blobs.mark() == known:
            return None
    except BlobsUnreachableError as error:
        return f"{blobs.place} cannot be used: {error}"
    return f"{blobs.place} is not the place where the others keep pictures; {_ONE}"


def join(client: redis.Redis, keys: Keys, blobs: Blobs, name: str) -> None:
    """For a worker, before it takes jobs: return once its place is the one that counts; log why it
    waits."""
    last = None
    while why := _hindrance(client, keys, blobs):
        if why != last:
            log.error("worker does not join", worker=name, why=why)
            last = why
        client.set(keys.outsider, f"worker {name} does not join: {why}", px=_REMEMBERED_MS)
        time.sleep(_LOOK_AGAIN_S)


def _hindrance(client: redis.Redis, keys: Keys, blobs: Blobs) -> str | None:
    if client.get(keys.blobs) is None:
        try:
            client.set(keys.blobs, blobs.mark(make=True) or "", nx=True)
        except BlobsUnreachableError as error:
            return f"{blobs.place} cannot be used: {error}"
    return apart(client, keys, blobs)
