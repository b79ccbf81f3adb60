"""Do the service and its workers see the same pictures? Those that do not would fail every job they take.

Strategy: the folder of the blobs holds a mark, an id that was made with it. The queue server knows the mark of the
folder that counts: the service's, or, before one has started, that of the first worker. A worker whose folder has
another mark, or none, does not join.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import cast
from uuid import uuid4

import redis
import structlog

from workers.presence import present
from workers.record import BLOBS, OUTSIDER
from workers.settings import Settings

_MARK = "mark"
_LOOK_AGAIN_S = 1.0
_REMEMBERED_MS = 5000

log = structlog.get_logger(__name__)


def mark_of(folder: Path) -> str:
    """The folder's mark; made with the folder when there is none yet."""
    if known := _found(folder):
        return known
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    beside = folder / f"{_MARK}.{uuid4().hex}"
    beside.write_text(uuid4().hex)
    with contextlib.suppress(FileExistsError):
        os.link(beside, folder / _MARK)  # whole at once: nobody reads half a mark
    beside.unlink()
    return (folder / _MARK).read_text()


def claim(client: redis.Redis, folder: Path) -> None:
    """For a service, again and again: its folder counts, unless ready workers share another one."""
    ours = mark_of(folder)
    if client.set(BLOBS, ours, nx=True) or client.get(BLOBS) == ours:
        return
    if not any(worker.ready for worker in present(client)):
        client.set(BLOBS, ours)


def apart(client: redis.Redis, folder: Path) -> str | None:
    """Why a process with this folder cannot exchange pictures with the others; None if it can."""
    known = cast(str | None, client.get(BLOBS))
    if known is None or _found(folder) == known:
        return None
    return f"{folder} is not the folder in which the others keep pictures; give all of them one DLO_DATA_DIR"


def join(client: redis.Redis, settings: Settings, name: str) -> None:
    """For a worker, before it takes jobs: return once its folder is the one that counts; say why it waits."""
    told = None
    if client.get(BLOBS) is None:
        client.set(BLOBS, mark_of(settings.blobs_dir), nx=True)
    while why := apart(client, settings.blobs_dir):
        if why != told:
            log.error("worker does not join", worker=name, why=why)
            told = why
        client.set(OUTSIDER, f"worker {name} does not join: {why}", px=_REMEMBERED_MS)
        time.sleep(_LOOK_AGAIN_S)


def _found(folder: Path) -> str | None:
    try:
        return (folder / _MARK).read_text()
    except OSError:
        return None
