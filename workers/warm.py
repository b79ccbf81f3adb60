"""The warm worker: RQ brings job ids, one persistent child runs the jobs.

Strategy: of RQ only the queues, the blocking read over both of them and the warm shutdown on SIGTERM are
used. What a job is and how it stands is in its record (:mod:`workers.ledger`). The worker claims the job,
hands the claim to its child, and until the child is done renews the claim five times a second. A claim that
is gone — cancelled, or taken by a reaper — or a deadline that has come means: kill the child, whatever
native code it is in. A child that dies by itself ends the wait at once. The next child is warm by then
(:mod:`workers.children`) and takes the next job.
"""

from __future__ import annotations

import contextlib
import time
from datetime import UTC, datetime
from types import FrameType
from typing import cast
from uuid import uuid4

import redis
import structlog
from redis.backoff import NoBackoff
from redis.retry import Retry
from rq.job import Job
from rq.queue import Queue
from rq.serializers import JSONSerializer
from rq.worker import Worker
from rq.worker.base import WorkerStatus
from rq.worker_registration import clean_worker_registry

from workers import presence, problems, reaper, watchdog, webhooks
from workers.allowed import AllowedJob
from workers.blobs import FolderBlobs
from workers.child_process import ChildDied, ChildProcess
from workers.children import Children
from workers.connection import connect
from workers.ledger import Claim, Ledger
from workers.record import QUEUES
from workers.repeater import Repeater
from workers.settings import Settings

_RENEW_S = 0.2
_ANNOUNCE_S = 1.0
_SWEEP_S = 300.0
_LOOK_AFTER_CHILD_S = 3
_RQ_WORKER_TTL_S = 30
_STUCK_S = 60.0
"""A worker whose main thread has not turned for so long no longer gives signs of life."""

log = structlog.get_logger(__name__)


class WarmWorker(Worker):
    """One worker, one child; ``name`` gets a suffix, so that a killed worker's successor may bear it too."""

    def __init__(self, settings: Settings, name: str) -> None:
        super().__init__(
            list(QUEUES),
            name=f"{name}-{uuid4().hex[:6]}",
            connection=connect(settings, patient=True, text=False),
            job_class=AllowedJob,
            serializer=JSONSerializer,
            worker_ttl=_RQ_WORKER_TTL_S,
            log_job_description=False,
        )
        self._children = Children(settings, self._turned)
        self._turn = time.monotonic()
        self._patient = connect(settings, patient=True)
        self._impatient = connect(settings)
        self._ledger = Ledger(self._patient, settings)
        self._renewals = Ledger(self._impatient, settings)
        self._started_at = datetime.now(UTC)
        self._asked_to_stop = False
        blobs = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s)
        self._upkeep = [
            Repeater("announce", _ANNOUNCE_S, self._announce),
            Repeater("reap", reaper.INTERVAL_S, lambda: reaper.reap(self._impatient, self._renewals)),
            Repeater("sweep", _SWEEP_S, blobs.sweep),
            Repeater("webhooks", webhooks.INTERVAL_S, webhooks.Courier(self._impatient, settings).deliver),
        ]

    def serve(self) -> bool:
        """Work until SIGTERM; False if it ended for another reason."""
        for repeater in self._upkeep:
            repeater.start()
        try:
            self.work(logging_level="WARNING")
        finally:
            self._children.kill()
            for repeater in self._upkeep:
                repeater.stop()
            with contextlib.suppress(redis.RedisError):
                presence.depart(self._impatient, self.name)
        return self._asked_to_stop

    # RQ calls what follows.

    def dequeue_job_and_maintain_ttl(
        self, timeout: int | None, max_idle_time: int | None = None
    ) -> tuple[Job, Queue] | None:
        """The next job, taken only by a worker whose child is warm."""
        while not self._stop_requested:
            self._turned()
            self._ready_child()
            if entry := super().dequeue_job_and_maintain_ttl(timeout, _LOOK_AFTER_CHILD_S):
                return entry
        return None

    def execute_job(self, job: Job, queue: Queue) -> None:
        """Run one queue entry, if it may be and still has to be run."""
        self.set_state(WorkerStatus.BUSY)
        if refusal := cast(AllowedJob, job).refusal:
            log.error("queue entry refused", job_id=job.id, why=refusal)
            self._ledger.fail_queued(job.id, problems.refused())
            self.connection.delete(job.key)
        elif claim := self._ledger.claim(job.id, self.name):
            self._run(claim)
        else:
            log.info("job not run: cancelled, or too late", job_id=job.id)
        self.set_state(WorkerStatus.IDLE)

    def request_stop(self, signum: int, frame: FrameType | None) -> None:
        """SIGTERM or SIGINT: finish the job, then end; a queue server that is away is not waited for.

        After a second one the job is given up, and a reaper gives it to another worker.
        """
        self._asked_to_stop = True
        for client in (self.connection, self._patient):
            client.set_retry(Retry(NoBackoff(), 0))
        super().request_stop(signum, frame)  # type: ignore[no-untyped-call]

    def subscribe(self) -> None:
        """No commands over RQ's channel: cancelling goes through the job's record."""

    def set_shutdown_requested_date(self) -> None:
        """A signal handler does not talk to the queue server."""

    def run_maintenance_tasks(self) -> None:
        """Forget workers that were killed; RQ's own tasks could run callbacks that forged entries name."""
        for queue in self.queues:
            clean_worker_registry(queue)
        self.last_cleaned_at = datetime.now(UTC)  # type: ignore[assignment]

    def register_death(self) -> None:
        with contextlib.suppress(redis.RedisError):
            super().register_death()  # type: ignore[no-untyped-call]

    def _ready_child(self) -> None:
        """Have a warm child; the first time, and when it is another than before, everybody is told at once."""
        before = self._children.current.ready
        self._children.ready()
        self._children.tend()
        if not before:
            with contextlib.suppress(redis.RedisError):
                self._announce()

    def _turned(self) -> None:
        self._turn = time.monotonic()

    def _run(self, claim: Claim) -> None:
        """See the claimed job through to one of its ends."""
        child = self._children.current
        try:
            child.give(claim)
            if self._watch(child, claim):
                child.finish()
            else:
                child.kill()
        except ChildDied:
            too_large = child.died_of_memory
            child.kill()
            if too_large:
                self._ledger.fail(claim, problems.too_large())
                log.error("child died of memory", job_id=claim.job_id)
            else:
                log.error("child died", job_id=claim.job_id, then=self._ledger.lost(claim))

    def _watch(self, child: ChildProcess, claim: Claim) -> bool:
        """Wait for the child while the claim is held and time is left; False if it has to be killed."""
        limit = time.monotonic() + claim.remaining_s
        while not child.wait(min(_RENEW_S, max(limit - time.monotonic(), 0.0))):
            self._turned()
            if child.frozen:
                raise ChildDied("it does not take up its job")
            if time.monotonic() >= limit:
                child.kill()  # first, so that it cannot end the job behind our back
                self._ledger.fail(claim, problems.timed_out())
                log.warning("job stopped at its time limit", job_id=claim.job_id)
                return False
            if not self._held(claim):
                log.info("job stopped: cancelled, or taken over", job_id=claim.job_id)
                return False
        return True

    def _held(self, claim: Claim) -> bool:
        try:
            return self._renewals.renew(claim, self.name)
        except redis.RedisError:
            return True  # the queue server is away: go on, and ask again

    def _announce(self) -> None:
        """Tell the queue server that we are there, and whoever supervises us that we are alive."""
        if time.monotonic() - self._turn < _STUCK_S:
            watchdog.beat()
        child = self._children.current
        presence.announce(
            self._impatient,
            presence.WorkerInfo(
                name=self.name,
                ready=child.ready and child.alive,
                busy=self.get_state() == WorkerStatus.BUSY,
                queues=list(QUEUES),
                started_at=self._started_at,
                networks=child.networks,
            ),
        )
