"""The door to the queue: submit, look at, wait for and cancel jobs. Imports nothing heavy.

:class:`JobQueue` blocks and may be used from many threads; :class:`AsyncJobQueue` is its twin for an event loop.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any, cast
from uuid import uuid4

from dlo_client.contracts import AnyJob, AnyRequest

from workers import quota, shared_blobs
from workers.admission import Terms
from workers.async_queue import AsyncJobQueue
from workers.blobs import open_blobs
from workers.dead_letters import DeadLetters
from workers.dispatch import RUN, Dispatch
from workers.errors import IdempotencyConflict, JobGone, JobUnknown, QueueError, QueueFull
from workers.kept import Shelf
from workers.ledger import Ledger, Opening
from workers.presence import WorkerInfo
from workers.reaper import reap
from workers.record import QUEUES, Entry, Origin
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

_LARGE_REQUEST = 32 * 1024
"""Characters; a larger request waits in a blob, not in the memory of the queue server."""


class JobQueue(QueueView):
    """Jobs by id; every method raises ``redis.RedisError`` when the queue server does not
    answer."""

    def __init__(self, settings: Settings, dispatch: Dispatch | None = None) -> None:
        """``dispatch``: RQ's unless another is given."""
        super().__init__(settings)
        self._blobs = open_blobs(settings)
        self._ledger = Ledger(self._client, settings, dispatch)
        self.dead_letters = DeadLetters(self._client, self._keys)
        self.recipes = Shelf(self._client, self._keys, "recipes")
        self.cameras = Shelf(self._client, self._keys, "cameras")
        self._charge = self._client.register_script(quota.CHARGE)

    def submit(self, request: AnyRequest | Entry, **options: Any) -> tuple[AnyJob, bool]:
        """As :meth:`put`; the job as it stands."""
        job_id, is_new = self.put(
            request if isinstance(request, Entry) else Entry.of(request), **options
        )
        return self.get(job_id), is_new

    def put(
        self,
        entry: Entry,
        *,
        idempotency_key: str | None = None,
        request_digest: str = "",
        keep: Callable[[], None] | None = None,
        origin: Origin = Origin(),  # noqa: B008 (frozen)
        most_jobs: int | None = None,
    ) -> tuple[str, bool]:
        """Put a request, its pictures all uploaded, into the queue; the job's id, and whether it is
        a new one.

        With a key that was used within ``idempotency_ttl_s`` for a request of the same digest the
        job of then is returned. ``keep`` is called once there is room and before a worker can see
        the job. The job is that of ``origin.owner``, who may have ``most_jobs`` under way. Raises
        QueueFull, NoRoomError and IdempotencyConflict.
        """
        terms = self._terms(idempotency_key, origin.owner, most_jobs, request_digest)
        is_large, request_blob = len(entry.request) > _LARGE_REQUEST, ""
        if keep or is_large:  # what is written down is for a job that enters
            if known := self._ledger.admit(terms):
                return known, False
            terms = terms.with_room()
            if keep:
                keep()
            request_blob = self._blobs.put(entry.request.encode()) if is_large else ""
        for blob_id in entry.pictures:
            self._blobs.touch(blob_id)  # they live longer than any job may wait
        opening = self._ledger.opening(
            uuid4().hex, entry, terms, request_blob=request_blob, origin=origin
        )
        known = self._ledger.open(opening)
        return known or opening.job_id, known is None

    def opening(
        self,
        entry: Entry,
        *,
        idempotency_key: str | None = None,
        request_digest: str = "",
        origin: Origin = Origin(),  # noqa: B008 (frozen)
        most_jobs: int | None = None,
    ) -> Opening | None:
        """What :meth:`put` does with a request whose pictures were all seen a moment ago, for a
        client on an event loop; None for one that is too large for the memory of the queue
        server."""
        if len(entry.request) > _LARGE_REQUEST:
            return None
        terms = self._terms(idempotency_key, origin.owner, most_jobs, request_digest)
        return self._ledger.opening(uuid4().hex, entry, terms, origin=origin)

    def check_room(
        self, idempotency_key: str | None = None, owner: str = "", most_jobs: int | None = None
    ) -> None:
        """Raise QueueFull now if a submission like this would, before its body is read."""
        with contextlib.suppress(IdempotencyConflict):  # the digest is not known yet
            self._ledger.admit(self._terms(idempotency_key, owner, most_jobs))

    def cancel(self, job_id: str) -> AnyJob:
        """Cancel a job that is not over, and return it; raises JobUnknown or JobGone.

        The worker of a running one kills it within a second.
        """
        self._ledger.cancel(job_id)
        return self.get(job_id)

    def charge(self, owner: str, most_bytes: int | None, sizes: Mapping[str, int]) -> None:
        """Note that ``owner`` keeps these blobs; raises QuotaExceededError if it may not keep so
        much."""
        if most_bytes is None or not sizes:
            return
        arguments = quota.charge_arguments(most_bytes, self._settings.blob_ttl_s, sizes)
        if not self._charge(keys=self._keys.stored(owner), args=arguments):
            raise quota.QuotaExceededError(owner)

    def reap(self) -> int:
        """Put right jobs whose worker is gone; workers do it, a service may too. Returns how
        many."""
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

    def _terms(
        self, given_key: str | None, owner: str, most_jobs: int | None, digest: str = ""
    ) -> Terms:
        return Terms(
            max_depth=self._settings.max_queue_depth,
            max_bytes=self._settings.max_queue_bytes,
            owner=owner,
            most_jobs=most_jobs,
            key=self._keys.idempotency(given_key, owner) if given_key else "",
            digest=digest,
        )
