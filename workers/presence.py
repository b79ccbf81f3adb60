"""Which workers are there: each announces itself again and again under a key that soon expires."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import cast

import redis
from dlo_client.contracts import NetworkInfo
from dlo_client.version import __version__

from workers.keys import Keys

EXPIRY_MS = 5000


@dataclass(frozen=True)
class WorkerInfo:
    """A live worker; ``ready`` once its child has loaded and warmed its networks."""

    name: str
    ready: bool
    busy: bool
    queues: list[str]
    started_at: datetime
    networks: list[NetworkInfo]
    version: str = __version__
    memory_mb: float = 0.0
    """Of its child, now."""


def announce(client: redis.Redis, keys: Keys, worker: WorkerInfo) -> None:
    """Say that ``worker`` is there; to be repeated well within ``EXPIRY_MS``."""
    announcement = {
        "name": worker.name,
        "ready": worker.ready,
        "busy": worker.busy,
        "queues": worker.queues,
        "started_at": worker.started_at.timestamp(),
        "networks": [network.model_dump() for network in worker.networks],
        "version": worker.version,
        "memory_mb": worker.memory_mb,
    }
    with client.pipeline() as pipeline:
        pipeline.sadd(keys.workers, worker.name)
        pipeline.set(keys.worker(worker.name), json.dumps(announcement), px=EXPIRY_MS)
        pipeline.execute()


def depart(client: redis.Redis, keys: Keys, name: str) -> None:
    with client.pipeline() as pipeline:
        pipeline.srem(keys.workers, name)
        pipeline.delete(keys.worker(name))
        pipeline.execute()


def present(client: redis.Redis, keys: Keys) -> list[WorkerInfo]:
    """The live workers, by name; forgets the names of dead ones."""
    names = sorted(cast(set[str], client.smembers(keys.workers)))
    if not names:
        return []
    announcements = cast(list[str | None], client.mget([keys.worker(name) for name in names]))
    if dead := [name for name, said in zip(names, announcements, strict=True) if said is None]:
        client.srem(keys.workers, *dead)
    return [_read(said) for said in announcements if said is not None]


def _read(said: str) -> WorkerInfo:
    fields = json.loads(said)
    fields["started_at"] = datetime.fromtimestamp(fields["started_at"], UTC)
    fields["networks"] = [NetworkInfo(**network) for network in fields["networks"]]
    return WorkerInfo(**fields)
