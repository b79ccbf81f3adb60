"""Runs the jobs whose ids an engine brings: claims them, hands them to the warm child, watches,
announces itself.

Strategy: what a job is and how it stands is in its record (:mod:`workers.ledger`). The runner
claims the job, hands the claim to its child, and until the child is done renews the claim five
times a second. A claim that is gone — cancelled, or taken by a reaper — or a deadline that has come
means: kill the child, whatever native code it is in. A child that dies by itself ends the wait at
once. The next child is warm by then (:mod:`workers.children`) and takes the next job. It also takes
an interactive job that comes while one of batch runs: the working child stands still meanwhile,
keeps its claim, and goes on where it was.

Nothing here knows RQ: an engine calls :meth:`Runner.ready` before it takes an id and
:meth:`Runner.run` with it, and gives the runner a function that takes the id of an interactive job.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime

import redis
import structlog
from redis.backoff import NoBackoff
from redis.retry import Retry

from workers import presence, problems, reaper, watchdog, webhooks
from workers.blobs import open_blobs
from workers.child_process import ChildDied, ChildProcess
from workers.children import Children
from workers.connection import connect
from workers.kept import sweep
from workers.ledger import Claim, Hold, Ledger
from workers.record import QUEUES
from workers.repeater import Repeater
from workers.settings import Settings
from workers.turns import Pauses

_RENEW_S = 0.2
_REPORT_WITHIN_S = 5.0
"""A child reports a moment after it has ended a job; one that does not is at work on what was taken
from it."""
_ANNOUNCE_S = 1.0
_SWEEP_S = 300.0
_STUCK_S = 60.0
"""A worker whose main thread has not turned for so long no longer gives signs of life."""

log = structlog.get_logger(__name__)


class Runner:
    """One warm child, under the name of its worker; all methods from one thread that lives on."""

    def __init__(
        self,
        settings: Settings,
        name: str,
        queues: Sequence[str] = QUEUES,
        take_interactive: Callable[[], str | None] = lambda: None,
    ) -> None:
        """``take_interactive``: the id of an interactive job that waits, if any; it does not wait
        for one."""
        self.name, self._queues = name, list(queues)
        self._take_interactive = take_interactive
        self._batch_share = settings.batch_share
        self._standing: Claim | None = None
        self._children = Children(settings, self._turned)
        self._turn = time.monotonic()
        self._busy = False
        self._keys = settings.keys
        self._patient = connect(settings, patient=True)
        self._impatient = connect(settings)
        self._ledger = Ledger(self._patient, settings)
        self._renewals = Ledger(self._impatient, settings)
        self._started_at = datetime.now(UTC)
        courier = webhooks.Courier(self._impatient, settings)
        blobs = open_blobs(settings)
        self._upkeep = [
            Repeater("announce", _ANNOUNCE_S, self._announce),
            Repeater(
                "reap",
                reaper.INTERVAL_S,
                lambda: reaper.reap(self._impatient, self._keys, self._renewals),
            ),
            Repeater("sweep", _SWEEP_S, lambda: sweep(blobs, self._impatient, self._keys)),
            Repeater("webhooks", webhooks.INTERVAL_S, courier.deliver),
        ]

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Look after everything meanwhile; at the end the child is gone and the worker has
        departed."""
        for repeater in self._upkeep:
            repeater.start()
        try:
            yield
        finally:
            self._children.kill()
            for repeater in self._upkeep:
                repeater.stop()
            with contextlib.suppress(redis.RedisError):
                presence.depart(self._impatient, self._keys, self.name)

    def ready(self) -> None:
        """Return once a child is warm; the first time, and when it is another than before, announce
        it at once."""
        self._turned()
        before = self._children.current.ready
        self._children.ready()
        self._children.tend()
        self._children.ready()  # a child that was too worn to go on is gone now
        if not before:
            with contextlib.suppress(redis.RedisError):
                self._announce()

    def run(self, job_id: str) -> None:
        """Run a job, if it still has to be run."""
        self._busy = True
        if claim := self._ledger.claim(job_id, self.name):
            self._see_through(self._children.current, claim)
        else:
            log.info("job not run: cancelled, or too late", job_id=job_id)
        self._busy = False

    def refuse(self, job_id: str, why: str) -> None:
        """Fail a job whose queue entry is forged."""
        log.error("queue entry refused", job_id=job_id, why=why)
        self._ledger.fail_queued(job_id, problems.refused())

    def stop_waiting(self) -> None:
        """From now on a queue server that is away is not waited for."""
        self._patient.set_retry(Retry(NoBackoff(), 0))

    def _turned(self) -> None:
        self._turn = time.monotonic()

    def _see_through(self, child: ChildProcess, claim: Claim) -> None:
        """See the claimed job through to one of its ends."""
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
        """Wait for the child while the claim is held and time is left; False if it has to be
        killed."""
        limit = time.monotonic() + claim.remaining_s
        pauses = Pauses(self._batch_share)
        while not child.wait(min(_RENEW_S, max(limit - time.monotonic(), 0.0))):
            self._turned()
            if child.frozen:
                raise ChildDied("it does not take up its job")
            if time.monotonic() >= limit:
                child.kill()  # first, so that it cannot end the job behind our back
                self._ledger.fail(claim, problems.timed_out())
                log.warning("job stopped at its time limit", job_id=claim.job_id)
                return False
            hold = self._hold(claim)
            if hold == "wanted":
                limit += self._let_pass(child, claim, pauses)
            elif hold == "ended" and child.wait(_REPORT_WITHIN_S):
                return True
            elif hold != "held":
                log.info("job stopped: cancelled, or taken over", job_id=claim.job_id)
                return False
        return True

    def _let_pass(self, child: ChildProcess, claim: Claim, pauses: Pauses) -> float:
        """Run an interactive job while the child with the claim stands still; for how many seconds
        it did."""
        if not (pauses.allowed and child.has_begun and (other := self._children.standby())):
            return 0.0
        if (job_id := self._take_interactive()) is None:
            return 0.0
        started = time.monotonic()
        child.pause()
        self._standing = claim
        try:
            log.info("job stands still for an interactive one", job_id=claim.job_id, other=job_id)
            with contextlib.suppress(redis.RedisError):  # a reaper puts it right
                if passing := self._renewals.claim(job_id, self.name):
                    self._see_through(other, passing)
        finally:
            self._standing = None
            child.resume()
        stood_s = time.monotonic() - started
        pauses.add(stood_s)
        self._hold(claim, stood_s)
        return stood_s

    def _hold(self, claim: Claim, stood_s: float = 0.0) -> Hold:
        try:
            if self._standing is not None:
                self._renewals.renew(self._standing, self.name)
            return self._renewals.renew(claim, self.name, stood_s)
        except redis.RedisError:
            return "held"  # the queue server is away: go on, and ask again

    def _announce(self) -> None:
        """Write down that we are there, and give whoever supervises us a sign of life."""
        if time.monotonic() - self._turn < _STUCK_S:
            watchdog.beat()
        child = self._children.current
        presence.announce(
            self._impatient,
            self._keys,
            presence.WorkerInfo(
                name=self.name,
                ready=child.ready and child.alive,
                busy=self._busy,
                queues=self._queues,
                started_at=self._started_at,
                networks=child.networks,
                memory_mb=child.memory_mb,
            ),
        )
