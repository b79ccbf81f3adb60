"""The worker that RQ brings job ids to; what it does with them is :mod:`workers.runner`.

Of RQ only the queues, the blocking read over both of them and the warm shutdown on SIGTERM are
used. What it writes down about its worker is kept off the way of a job: a dozen trips to the queue
server around each, which nobody reads, as workers announce themselves (:mod:`workers.presence`).
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from types import FrameType
from typing import cast
from uuid import uuid4

import redis
from redis.backoff import NoBackoff
from redis.client import Pipeline
from redis.retry import Retry
from rq.exceptions import NoSuchJobError
from rq.job import Job
from rq.queue import Queue
from rq.serializers import JSONSerializer
from rq.utils import as_text
from rq.worker import Worker
from rq.worker.base import WorkerStatus
from rq.worker_registration import clean_worker_registry

from workers.allowed import AllowedJob
from workers.connection import connect
from workers.record import QUEUES
from workers.runner import Runner
from workers.settings import Settings
from workers.turns import Turns

_LOOK_AFTER_CHILD_S = 3
_RQ_WORKER_TTL_S = 30
_HEARTBEAT_S = 10.0
"""RQ forgets a worker a minute after its TTL."""


class WarmWorker(Worker):
    """One worker, one child; ``name`` gets a suffix, so that a killed worker's successor may bear
    it too."""

    def __init__(self, settings: Settings, name: str, queues: Sequence[str] = QUEUES) -> None:
        super().__init__(
            [settings.keys.queue(priority) for priority in queues],
            name=f"{name}-{uuid4().hex[:6]}",
            connection=connect(settings, patient=True, text=False),
            job_class=AllowedJob,
            serializer=JSONSerializer,
            worker_ttl=_RQ_WORKER_TTL_S,
            log_job_description=False,
        )
        self._preempts = settings.preempt and set(QUEUES) <= set(queues)
        self._runner = Runner(settings, self.name, queues, self._take_interactive)
        self._interactive = Queue.redis_queue_namespace_prefix + settings.keys.queue("interactive")
        self._impatient = connect(settings, text=False)
        self._both = tuple(queues) == QUEUES
        self._turns = Turns(settings.batch_share)
        self._asked_to_stop = False
        self._beat = -_HEARTBEAT_S

    def serve(self) -> bool:
        """Work until SIGTERM; False if it ended for another reason."""
        with self._runner.on_duty():
            self.work(logging_level="WARNING")
        return self._asked_to_stop

    # RQ calls what follows.

    def dequeue_job_and_maintain_ttl(
        self, timeout: int | None, max_idle_time: int | None = None
    ) -> tuple[Job, Queue] | None:
        """The next job, taken only by a worker whose child is warm."""
        while not self._stop_requested:
            self._runner.ready()
            if entry := super().dequeue_job_and_maintain_ttl(timeout, _LOOK_AFTER_CHILD_S):
                return entry
        return None

    def reorder_queues(self, reference_queue: Queue) -> None:
        """Called with the queue that the job at hand came from; turns are for workers of both
        queues alone."""
        if not self._both:
            return
        interactive, batch = self.queues
        self._turns.taken(batch=reference_queue.name == batch.name)
        self._ordered_queues = (
            [batch, interactive] if self._turns.batch_first else [interactive, batch]
        )

    def execute_job(self, job: Job, queue: Queue) -> None:
        """Run one queue entry, if it may be and still has to be run."""
        self.set_state(WorkerStatus.BUSY)
        if self._may_run(cast(AllowedJob, job)):
            self._runner.run(job.id)
        self.set_state(WorkerStatus.IDLE)

    def _take_interactive(self) -> str | None:
        """Called while a batch job runs: the id of a job that need not wait for its end."""
        if not self._preempts or self._stop_requested:
            return None
        try:
            if (taken := self._impatient.lpop(self._interactive)) is None:
                return None
            job_id = as_text(cast(bytes, taken))
            entry = AllowedJob.fetch(job_id, self._impatient, self.serializer)
        except (NoSuchJobError, redis.RedisError):  # a reaper puts back what was taken
            return None
        return job_id if self._may_run(entry) else None

    def _may_run(self, entry: AllowedJob) -> bool:
        """Refuse a forged queue entry."""
        if entry.refusal:
            self._runner.refuse(entry.id, entry.refusal)
            self.connection.delete(entry.key)
        return entry.refusal is None

    def heartbeat(self, timeout: int | None = None, pipeline: Pipeline | None = None) -> None:
        """Called several times a job."""
        if pipeline is not None:
            super().heartbeat(timeout, pipeline)
        elif time.monotonic() - self._beat >= _HEARTBEAT_S:
            self._beat = time.monotonic()
            with self.connection.pipeline(transaction=False) as trip:
                super().heartbeat(timeout, trip)
                trip.execute()

    def set_state(self, state: str, pipeline: Pipeline | None = None) -> None:
        """Kept here alone: a worker that is asked to stop ends its job first if it is busy. Others
        read that in its announcement."""
        self._state = state

    def check_for_suspension(self, burst: bool) -> None:
        """Workers are held by stopping them, not by a key in the queue server."""

    def request_stop(self, signum: int, frame: FrameType | None) -> None:
        """SIGTERM or SIGINT: finish the job, then end; a queue server that is away is not waited
        for.

        After a second one the job is given up, and a reaper gives it to another worker.
        """
        self._asked_to_stop = True
        self.connection.set_retry(Retry(NoBackoff(), 0))
        self._runner.stop_waiting()
        super().request_stop(signum, frame)  # type: ignore[no-untyped-call]

    def subscribe(self) -> None:
        """No commands over RQ's channel: cancelling goes through the job's record."""

    def set_shutdown_requested_date(self) -> None:
        """A signal handler does not talk to the queue server."""

    def run_maintenance_tasks(self) -> None:
        """Forget workers that were killed; RQ's own tasks could run callbacks that forged entries
        name."""
        for queue in self.queues:
            clean_worker_registry(queue)
        self.last_cleaned_at = datetime.now(UTC)  # type: ignore[assignment]

    def register_death(self) -> None:
        with contextlib.suppress(redis.RedisError):
            super().register_death()  # type: ignore[no-untyped-call]
