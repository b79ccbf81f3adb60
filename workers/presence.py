"""Which workers are there: each announces itself again and again under a key that soon expires."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import cast

import redis
from dlo_client.contracts import NetworkInfo

from workers.record import WORKERS, worker_key

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


def announce(client: redis.Redis, worker: WorkerInfo) -> None:
    """Say that ``worker`` is there; to be repeated well within ``EXPIRY_MS``."""
    announcement = {
        "name": worker.name,
        "ready": worker.ready,
        "busy": worker.busy,
        "queues": worker.queues,
        "started_at": worker.started_at.timestamp(),
        "networks": [network.model_dump() for network in worker.networks],
    }
    with client.pipeline() as pipeline:
        pipeline.sadd(WORKERS, worker.name)
        pipeline.set(worker_key(worker.name), json.dumps(announcement), px=EXPIRY_MS)
        pipeline.execute()


def depart(client: redis.Redis, name: str) -> None:
    with client.pipeline() as pipeline:
        pipeline.srem(WORKERS, name)
        pipeline.delete(worker_key(name))
        pipeline.execute()


def present(client: redis.Redis) -> list[WorkerInfo]:
    """The live workers, by name; forgets the names of dead ones."""
    names = sorted(cast(set[str], client.smembers(WORKERS)))
    if not names:
        return []
    announcements = cast(list[str | None], client.mget([worker_key(name) for name in names]))
    if dead := [name for name, said in zip(names, announcements, strict=True) if said is None]:
        client.srem(WORKERS, *dead)
    return [_read(said) for said in announcements if said is not None]


def _read(said: str) -> WorkerInfo:
    fields = json.loads(said)
    fields["started_at"] = datetime.fromtimestamp(fields["started_at"], UTC)
    fields["networks"] = [NetworkInfo(**network) for network in fields["networks"]]
    return WorkerInfo(**fields)
