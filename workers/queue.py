"""The door to the queue: submit, look at, wait for and cancel jobs. Imports nothing heavy.

:class:`JobQueue` blocks and may be used from many threads; :class:`AsyncJobQueue` is its twin for an event
loop, so that hundreds of waiters need no threads.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any, cast
from uuid import uuid4

import redis
import redis.asyncio
from dlo_client.contracts import AnyJob, AnyRequest, JobEvent, JobKind, JobPage, JobState, NetworkInfo
from rq.queue import Queue
from rq.serializers import JSONSerializer

from workers import quota, shared_folder
from workers.blobs import FolderBlobs
from workers.connection import LONGEST_BLOCK_MS, connect, connect_async
from workers.dead_letters import DeadLetters
from workers.errors import IdempotencyConflict, JobGone, JobUnknown, QueueError, QueueFull
from workers.ledger import Ledger
from workers.listing import recent_page
from workers.presence import WorkerInfo, present
from workers.reaper import reap
from workers.record import (
    COUNTS,
    OUTSIDER,
    QUEUES,
    Entry,
    JobRecord,
    events_key,
    job_key,
    owned_key,
    read_event,
    read_job,
    tombstone_key,
)
from workers.settings import Settings

__all__ = [
    "QUEUES",
    "AsyncJobQueue",
    "IdempotencyConflict",
    "JobGone",
    "JobQueue",
    "JobUnknown",
    "QueueError",
    "QueueFull",
    "WorkerInfo",
]

RUN = "workers.jobs.run"
"""The one function that a queue entry may name."""

_RETRY_AFTER_S = 5.0
_LARGE_REQUEST = 32 * 1024
"""Characters; a larger request waits in a blob, not in the memory of the queue server."""
_EVENT_ID = re.compile(r"\d{1,20}(-\d{1,20})?")


def _nothing() -> None:
    """Where no pictures have to be kept."""


class JobQueue:
    """Jobs by id; every method raises ``redis.RedisError`` when the queue server does not answer."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._client = connect(settings)
        self._blobs = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s, settings.disk_reserve_bytes)
        self._ledger = Ledger(self._client, settings)
        self.dead_letters = DeadLetters(self._client)
        self._charge = self._client.register_script(quota.CHARGE)
        self._queues: dict[str, Queue] = {
            name: Queue(name, connection=self._client, serializer=JSONSerializer) for name in QUEUES
        }

    def submit(
        self,
        request: AnyRequest | Entry,
        *,
        idempotency_key: str | None = None,
        request_digest: str | None = None,
        keep: Callable[[], None] = _nothing,
        owner: str = "",
        most_jobs: int | None = None,
    ) -> tuple[AnyJob, bool]:
        """Put a request, its pictures all uploaded, into the queue; the job, and whether it is a new one.

        With a key that was used within ``idempotency_ttl_s`` for a request of the same digest the job of
        then is returned. ``keep`` is called, perhaps again, once there is room and before a worker can see
        the job. The job is ``owner``'s, who may have ``most_jobs`` under way. Raises QueueFull, NoRoomError,
        IdempotencyConflict, and JobGone when the job of then has expired.
        """
        entry = request if isinstance(request, Entry) else Entry.of(request)
        key = _idempotency_key(idempotency_key, owner)
        digest = request_digest or ""
        job_id = uuid4().hex

        def put(pipeline: redis.client.Pipeline) -> str:
            if key and (known := _known(cast(str | None, pipeline.get(key)), digest)):
                return known
            self._make_room(owner, most_jobs)
            keep()
            blob_id = self._blobs.put(entry.request.encode()) if len(entry.request) > _LARGE_REQUEST else ""
            pipeline.multi()
            self._put(pipeline, job_id, entry, blob_id, owner)
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

    def get(self, job_id: str) -> AnyJob:
        """The job; raises JobUnknown or JobGone."""
        record = cast(dict[str, str], self._client.hgetall(job_key(job_id)))
        if not record:
            raise _absent(self._client.exists(tombstone_key(job_id)), job_id)
        return read_job(record)

    def cancel(self, job_id: str) -> AnyJob:
        """Cancel a job that is not over, and return it; raises JobUnknown or JobGone.

        The worker of a running one kills it within a second.
        """
        self._ledger.cancel(job_id)
        return self.get(job_id)

    def events(self, job_id: str, after: str = "0", block_ms: int = 0) -> list[JobEvent]:
        """The job's events after the event id ``after``; anything that is not such an id means all of them.

        Waits up to ``block_ms`` (at most ``LONGEST_BLOCK_MS``) for the first; none is an empty list.
        Raises JobUnknown or JobGone.
        """
        answer = self._client.xread(*_xread(job_id, after), block=_block(block_ms))
        if not answer and not self._client.exists(job_key(job_id)):
            raise _absent(self._client.exists(tombstone_key(job_id)), job_id)
        return _events(answer)

    def recent(
        self,
        *,
        limit: int = 50,
        cursor: str | None = None,
        state: JobState | None = None,
        kind: JobKind | None = None,
        owner: str | None = None,
    ) -> JobPage:
        """Jobs (of ``owner``, if given) newest first, without their results. ValueError on a cursor that is none."""
        return recent_page(self._client, limit=limit, cursor=cursor, state=state, kind=kind, owner=owner)

    def charge(self, owner: str, most_bytes: int | None, sizes: Mapping[str, int]) -> None:
        """Note that ``owner`` keeps these blobs; raises QuotaExceededError if it may not keep so much."""
        if most_bytes is None or not sizes:
            return
        arguments = quota.charge_arguments(most_bytes, self._settings.blob_ttl_s, sizes)
        if not self._charge(keys=quota.stored_keys(owner), args=arguments):
            raise quota.QuotaExceededError(owner)

    def workers(self) -> list[WorkerInfo]:
        """The live workers."""
        return present(self._client)

    def networks(self) -> list[NetworkInfo]:
        """What the live, ready workers have, each network once."""
        there = (network for worker in self.workers() if worker.ready for network in worker.networks)
        return list({(network.name, network.version): network for network in there}.values())

    def foreground_networks(self) -> list[str]:
        """Names that a request's ``model`` may take; empty as long as no live worker has announced any."""
        there = (network for worker in self.workers() for network in worker.networks)
        return sorted({network.name for network in there if network.task == "foreground"})

    def depth(self) -> dict[str, int]:
        """Jobs that wait, by queue."""
        with self._client.pipeline(transaction=False) as pipeline:
            for queue in self._queues.values():
                pipeline.llen(queue.key)
            return dict(zip(self._queues, pipeline.execute(), strict=True))

    def counts(self) -> dict[tuple[str, str], int]:
        """How many jobs of each kind have ever entered each state; every job enters ``queued``, once."""
        counted = {}
        for name, number in cast(dict[str, str], self._client.hgetall(COUNTS)).items():
            kind, state = name.split("|")
            counted[kind, state] = int(number)
        return counted

    def ping(self) -> bool:
        """Whether the queue server answers."""
        try:
            return bool(self._client.ping())
        except redis.RedisError:
            return False

    def reap(self) -> int:
        """Put right jobs whose worker is gone; workers do it, a service may too. Returns how many."""
        return reap(self._client, self._ledger)

    def claim_folder(self) -> None:
        """For a service, again and again: its folder of pictures is the one that counts."""
        shared_folder.claim(self._client, self._settings.blobs_dir)

    def apart(self) -> str | None:
        """Why the pictures kept here do not reach the workers; None if they do."""
        return shared_folder.apart(self._client, self._settings.blobs_dir)

    def outsider(self) -> str | None:
        """Why a worker that is there does not join; None if there is no such worker."""
        return cast(str | None, self._client.get(OUTSIDER))

    def close(self) -> None:
        self._client.close()

    def check_room(self, idempotency_key: str | None = None, owner: str = "", most_jobs: int | None = None) -> None:
        """Raise QueueFull now if a submission like this would, before its body is read."""
        key = _idempotency_key(idempotency_key, owner)
        if not (key and self._client.exists(key)):
            self._make_room(owner, most_jobs)

    def _put(self, pipeline: redis.client.Pipeline, job_id: str, entry: Entry, blob_id: str, owner: str) -> None:
        self._ledger.open(pipeline, job_id, entry, request_blob=blob_id, owner=owner)
        queue = self._queues[entry.priority]
        queue.enqueue_job(queue.create_job(RUN, args=(job_id,), job_id=job_id), pipeline=pipeline)

    def _make_room(self, owner: str, most_jobs: int | None) -> None:
        with self._client.pipeline(transaction=False) as pipeline:
            for queue in self._queues.values():
                pipeline.llen(queue.key)
            pipeline.scard(owned_key(owner))
            pipeline.info("memory")
            *depths, owned, memory = pipeline.execute()
        if sum(depths) >= self._settings.max_queue_depth:
            raise QueueFull("too many jobs wait", _RETRY_AFTER_S)
        if memory["used_memory"] >= self._settings.max_queue_bytes:
            raise QueueFull("the queue server holds as much as it may", _RETRY_AFTER_S)
        if most_jobs is not None and owned >= most_jobs:
            raise QueueFull(f"this key has {owned} jobs under way, as many as it may", _RETRY_AFTER_S)


class AsyncJobQueue:
    """The part of :class:`JobQueue` that waits, for an event loop."""

    def __init__(self, settings: Settings) -> None:
        self._client = connect_async(settings)
        self._pace = self._client.register_script(quota.PACE)

    async def get(self, job_id: str) -> JobRecord:
        """See :meth:`JobQueue.get`."""
        record = cast(dict[str, str], await self._client.hgetall(job_key(job_id)))
        if not record:
            raise _absent(await self._client.exists(tombstone_key(job_id)), job_id)
        return JobRecord.read(record)

    async def events(self, job_id: str, after: str = "0", block_ms: int = 0) -> list[JobEvent]:
        """See :meth:`JobQueue.events`."""
        answer = await self._client.xread(*_xread(job_id, after), block=_block(block_ms))
        if not answer and not await self._client.exists(job_key(job_id)):
            raise _absent(await self._client.exists(tombstone_key(job_id)), job_id)
        return _events(answer)

    async def pace(self, owner: str, per_minute: int) -> float:
        """Seconds that ``owner`` has to wait before its next request; 0 for one that may go on, and counts."""
        return float(await self._pace(keys=[quota.pace_key(owner)], args=[per_minute]))

    async def close(self) -> None:
        await self._client.aclose()


def _idempotency_key(given: str | None, owner: str) -> str | None:
    """Two owners may use the same one."""
    return given and f"dlo:idempotency:{hashlib.sha256(f'{owner}|{given}'.encode()).hexdigest()}"


def _known(value: str | None, digest: str) -> str | None:
    """The job that an idempotency key stands for; raises IdempotencyConflict."""
    if value is None:
        return None
    known_digest, job_id = value.rsplit(" ", 1)
    if known_digest != digest:
        raise IdempotencyConflict("the Idempotency-Key was used for another request")
    return job_id


def _absent(tombstone: int, job_id: str) -> QueueError:
    return JobGone(job_id) if tombstone else JobUnknown(job_id)


def _xread(job_id: str, after: str) -> tuple[Any]:
    return ({events_key(job_id): after if _EVENT_ID.fullmatch(after) else "0"},)


def _block(block_ms: int) -> int | None:
    """The server takes 0 for ever."""
    return max(0, min(block_ms, LONGEST_BLOCK_MS)) or None


def _events(answer: Any) -> list[JobEvent]:
    """One stream was read: redis-py answers a dict (RESP3) or a list of pairs (RESP2)."""
    streams = answer.values() if isinstance(answer, dict) else [entries for _, entries in answer]
    return [read_event(event_id, fields) for entries in streams for event_id, fields in entries]
