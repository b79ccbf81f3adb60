"""The door to the queue: submit, look at, wait for and cancel jobs. Imports nothing heavy.

:class:`JobQueue` blocks and may be used from many threads; :class:`AsyncJobQueue` is its twin for an event loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast
from uuid import uuid4

import redis
from dlo_client.contracts import AnyJob, AnyRequest

from workers import quota, shared_blobs
from workers.async_queue import AsyncJobQueue
from workers.blobs import open_blobs
from workers.dead_letters import DeadLetters
from workers.dispatch import RUN, Dispatch
from workers.errors import IdempotencyConflict, JobGone, JobUnknown, QueueError, QueueFull
from workers.kept import Shelf
from workers.ledger import Ledger
from workers.presence import WorkerInfo
from workers.reaper import reap
from workers.record import ALL_QUEUES, QUEUES, Entry, Origin
from workers.settings import Settings
from workers.view import QueueView

__all__ = [
    "QUEUES",
    "RUN",
    "AsyncJobQueue",
    "IdempotencyConflict",
    "JobGone",
    "JobQueue",
    "JobUnknown",
    "QueueError",
    "QueueFull",
    "WorkerInfo",
]

_RETRY_AFTER_S = 5.0
_LARGE_REQUEST = 32 * 1024
"""Characters; a larger request waits in a blob, not in the memory of the queue server."""


def _nothing() -> None:
    """Where no pictures have to be kept."""


class JobQueue(QueueView):
    """Jobs by id; every method raises ``redis.RedisError`` when the queue server does not answer."""

    def __init__(self, settings: Settings, dispatch: Dispatch | None = None) -> None:
        """``dispatch``: RQ's unless another is given."""
        super().__init__(settings)
        self._blobs = open_blobs(settings)
        self._ledger = Ledger(self._client, settings, dispatch)
        self.dead_letters = DeadLetters(self._client, self._keys)
        self.recipes = Shelf(self._client, self._keys, "recipes")
        self.cameras = Shelf(self._client, self._keys, "cameras")
        self._charge = self._client.register_script(quota.CHARGE)

    def submit(
        self,
        request: AnyRequest | Entry,
        *,
        idempotency_key: str | None = None,
        request_digest: str | None = None,
        keep: Callable[[], None] = _nothing,
        origin: Origin = Origin(),  # noqa: B008 (frozen)
        most_jobs: int | None = None,
    ) -> tuple[AnyJob, bool]:
        """Put a request, its pictures all uploaded, into the queue; the job, and whether it is a new one.

        With a key that was used within ``idempotency_ttl_s`` for a request of the same digest the job of
        then is returned. ``keep`` is called, perhaps again, once there is room and before a worker can see
        the job. The job is that of ``origin.owner``, who may have ``most_jobs`` under way. Raises QueueFull,
        NoRoomError, IdempotencyConflict, and JobGone when the job of then has expired.
        """
        entry = request if isinstance(request, Entry) else Entry.of(request)
        key = idempotency_key and self._keys.idempotency(idempotency_key, origin.owner)
        digest = request_digest or ""
        job_id = uuid4().hex

        def put(pipeline: redis.client.Pipeline) -> str:
            if key and (known := _known(cast(str | None, pipeline.get(key)), digest)):
                return known
            self._make_room(origin.owner, most_jobs)
            keep()
            blob_id = self._blobs.put(entry.request.encode()) if len(entry.request) > _LARGE_REQUEST else ""
            pipeline.multi()
            self._ledger.open(pipeline, job_id, entry, request_blob=blob_id, origin=origin)
            if key:
                ttl_ms = round(self._settings.idempotency_ttl_s * 1000)
                pipeline.set(key, f"{digest} {job_id}", px=ttl_ms)
            return job_id

        for blob_id in entry.pictures:
            self._blobs.touch(blob_id)  # they live longer than any job may wait
        watched = [key] if key else []
        put_any = cast(Callable[[redis.client.Pipeline], None], put)  # redis-py's type forgets the value
        put_id = cast(str, self._client.transaction(put_any, *watched, value_from_callable=True))
        return self.get(put_id), put_id == job_id

    def check_room(self, idempotency_key: str | None = None, owner: str = "", most_jobs: int | None = None) -> None:
        """Raise QueueFull now if a submission like this would, before its body is read."""
        if not (idempotency_key and self._client.exists(self._keys.idempotency(idempotency_key, owner))):
            self._make_room(owner, most_jobs)

    def cancel(self, job_id: str) -> AnyJob:
        """Cancel a job that is not over, and return it; raises JobUnknown or JobGone.

        The worker of a running one kills it within a second.
        """
        self._ledger.cancel(job_id)
        return self.get(job_id)

    def charge(self, owner: str, most_bytes: int | None, sizes: Mapping[str, int]) -> None:
        """Note that ``owner`` keeps these blobs; raises QuotaExceededError if it may not keep so much."""
        if most_bytes is None or not sizes:
            return
        arguments = quota.charge_arguments(most_bytes, self._settings.blob_ttl_s, sizes)
        if not self._charge(keys=self._keys.stored(owner), args=arguments):
            raise quota.QuotaExceededError(owner)

    def reap(self) -> int:
        """Put right jobs whose worker is gone; workers do it, a service may too. Returns how many."""
        return reap(self._client, self._keys, self._ledger)

    def claim_blobs(self) -> None:
        """For a service, again and again: its place of pictures is the one that counts."""
        shared_blobs.claim(self._client, self._keys, self._blobs)

    def apart(self) -> str | None:
        """Why the pictures kept here do not reach the workers; None if they do."""
        return shared_blobs.apart(self._client, self._keys, self._blobs)

    def outsider(self) -> str | None:
        """Why a worker that is there does not join; None if there is no such worker."""
        return cast(str | None, self._client.get(self._keys.outsider))

    def _make_room(self, owner: str, most_jobs: int | None) -> None:
        with self._client.pipeline(transaction=False) as pipeline:
            for name in ALL_QUEUES:
                pipeline.zcard(self._keys.waiting(name))
            pipeline.scard(self._keys.owned(owner))
            pipeline.info("memory")
            *depths, owned, memory = pipeline.execute()
        if sum(depths) >= self._settings.max_queue_depth:
            raise QueueFull("too many jobs wait", _RETRY_AFTER_S)
        if memory["used_memory"] >= self._settings.max_queue_bytes:
            raise QueueFull("the queue server holds as much as it may", _RETRY_AFTER_S)
        if most_jobs is not None and owned >= most_jobs:
            raise QueueFull(f"this key has {owned} jobs under way, as many as it may", _RETRY_AFTER_S)


def _known(value: str | None, digest: str) -> str | None:
    """The job that an idempotency key stands for; raises IdempotencyConflict."""
    if value is None:
        return None
    known_digest, job_id = value.rsplit(" ", 1)
    if known_digest != digest:
        raise IdempotencyConflict("the Idempotency-Key was used for another request")
    return job_id
