"""A batch job that stands still for an interactive one: without harm, and not for ever."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from dlo_client.contracts import ImportNetworkRequest, JobState, NoopRequest, NoopResult

from tests.processes import KEYS
from workers import turns
from workers.record import QUEUES
from workers.runner import Runner
from workers.turns import Pauses
from workers.warm import WarmWorker


def submit(queue, **fields):
    return queue.submit(NoopRequest(**fields))[0].id


def begin(queue, ledger, client, **fields):
    """The claim of a job, by default of batch, taken as RQ and a worker do it."""
    fields = {"priority": "batch"} | fields
    job_id = submit(queue, **fields)
    client.lrem(f"rq:queue:dlo:{fields['priority']}", 0, job_id)
    return ledger.claim(job_id, "w")


class Child:
    """Takes so many looks for each job; ``what`` is done to it is written down."""

    def __init__(self, what: list, looks: int, end=lambda claim: None) -> None:
        self._what, self._looks, self._end = what, looks, end
        self.has_begun, self.frozen, self.died_of_memory = True, False, False

    def give(self, claim):
        self._left = self._looks
        self._claim = claim
        self._what.append(f"give {claim.job_id}")

    def wait(self, seconds):
        self._left -= 1
        if self._left < 0:
            self._end(self._claim)
        return self._left < 0

    def __getattr__(self, name):
        return lambda: self._what.append(name)


def test_a_worker_is_asked_for_a_batch_job_while_an_interactive_one_waits(
    job_queue, ledger, client
):
    claim = begin(job_queue, ledger, client)
    assert ledger.renew(claim, "w") == "held"
    waiting = submit(job_queue)
    assert ledger.renew(claim, "w") == "wanted"
    job_queue.cancel(waiting)
    assert ledger.renew(claim, "w") == "held"


def test_interactive_jobs_do_not_stand_still_for_each_other(job_queue, ledger, client):
    claim = begin(job_queue, ledger, client, priority="interactive")
    submit(job_queue)
    assert ledger.renew(claim, "w") == "held"


def test_a_job_that_may_hold_a_lock_does_not_stand_still(job_queue, ledger, client):
    """Another import, of an interactive job, would wait for the lock of the one that stands still
    for it."""
    request = ImportNetworkRequest.model_construct(kind="import_network", priority="batch")
    client.hset(
        KEYS.job("1"),
        mapping={"state": "running", "attempts": 1, "priority": "batch", "kind": request.kind},
    )
    claim = SimpleNamespace(job_id="1", attempt=1)
    submit(job_queue)
    assert ledger.renew(claim, "w") == "held"


def test_the_time_that_it_stood_still_is_given_back(job_queue, ledger, client):
    claim = begin(job_queue, ledger, client)
    deadline = float(client.hget(KEYS.job(claim.job_id), "deadline"))
    ledger.renew(claim, "w", 2.5)
    assert float(client.hget(KEYS.job(claim.job_id), "deadline")) == pytest.approx(deadline + 2.5)
    assert job_queue.measures().counters["preempted", "noop"] == 1
    ledger.succeed(claim, NoopResult(held_s=0.0), [], {})
    ledger.renew(claim, "w", 2.5)
    assert job_queue.measures().counters["preempted", "noop"] == 1, "it had ended meanwhile"


def runner(settings, client, ledger, what, *, warm=True, looks=1):
    """A runner whose next child ends its job well."""
    taker = lambda: client.lpop("rq:queue:dlo:interactive")  # noqa: E731
    made = Runner(settings, "w", QUEUES, taker)
    other = Child(
        what, looks, end=lambda claim: ledger.succeed(claim, NoopResult(held_s=0.0), [], {})
    )
    made._children.standby = lambda: other if warm else None
    return made


def test_the_working_child_stands_still_while_the_next_one_works(
    settings, job_queue, ledger, client
):
    """A robot waited for the end of the batch job that was running, however long that took."""
    claim, robot, what = begin(job_queue, ledger, client), submit(job_queue), []
    child = Child(what, looks=3)
    runner(settings, client, ledger, what)._see_through(child, claim)
    assert what == [f"give {claim.job_id}", "pause", f"give {robot}", "finish", "resume", "finish"]
    assert job_queue.get(robot).state is JobState.SUCCEEDED
    batch = job_queue.get(claim.job_id)
    assert (batch.state, batch.attempts) == (JobState.RUNNING, 1)


def test_the_job_that_stands_still_is_not_taken_for_lost(settings, job_queue, ledger, client):
    """Nobody would give signs of life for it, and a reaper would hand it to another worker."""
    claim, what = begin(job_queue, ledger, client), []
    submit(job_queue)
    made = runner(settings, client, ledger, what, looks=2)
    looked = []
    give = Child.give

    class Silent(Child):
        def give(self, other):
            client.delete(KEYS.alive(claim.job_id))  # as by expiry
            give(self, other)

        def wait(self, seconds):
            looked.append(client.exists(KEYS.alive(claim.job_id)))
            return super().wait(seconds)

    other = Silent(what, 2)
    made._children.standby = lambda: other
    made._see_through(Child(what, looks=1), claim)
    assert looked == [0, 1, 1]


@pytest.mark.parametrize("case", ["no warm child", "not begun", "nobody waits any more"])
def test_it_goes_on_where_standing_still_would_help_nobody(
    settings, job_queue, ledger, client, case
):
    claim, robot, what = begin(job_queue, ledger, client), submit(job_queue), []
    made = runner(settings, client, ledger, what, warm=case != "no warm child")
    child = Child(what, looks=3)
    child.has_begun = case != "not begun"
    if case == "nobody waits any more":
        made._take_interactive = lambda: None
    made._see_through(child, claim)
    assert what == [f"give {claim.job_id}", "finish"]
    assert job_queue.get(robot).state is JobState.QUEUED


def test_a_child_that_dies_over_the_interactive_job_does_not_take_the_other_with_it(
    settings, job_queue, ledger, client
):
    claim, robot, what = begin(job_queue, ledger, client), submit(job_queue), []
    made = runner(settings, client, ledger, what)
    dying = Child(what, looks=5)
    dying.frozen = True
    made._children.standby = iter([dying, None]).__next__
    made._see_through(Child(what, looks=2), claim)
    assert what[-3:] == ["kill", "resume", "finish"]
    assert job_queue.get(robot).state is JobState.QUEUED
    assert job_queue.get(claim.job_id).state is JobState.RUNNING


def test_batch_has_its_share_of_the_time(monkeypatch):
    """A stream of interactive jobs would hold it up for ever."""
    now = [0.0]
    monkeypatch.setattr(turns.time, "monotonic", lambda: now[0])
    pauses = Pauses(0.1)
    stood = ran = 0.0
    for _ in range(1000):
        if pauses.allowed:
            now[0] += 1.0
            pauses.add(1.0)
            stood += 1.0
        else:
            now[0] += 0.01
            ran += 0.01
    assert ran / (ran + stood) == pytest.approx(0.1, abs=0.02)
    pauses.add(3600.0)
    now[0] += 1e6
    assert not pauses.allowed, "what it needs is kept so long"


@pytest.mark.parametrize(
    ("queues", "preempt", "taken"),
    [
        (QUEUES, True, True),
        (QUEUES, False, False),
        (("batch",), True, False),
        (("interactive",), True, False),
    ],
)
def test_which_workers_take_a_job_meanwhile(settings, job_queue, queues, preempt, taken):
    worker = WarmWorker(settings.model_copy(update={"preempt": preempt}), "w", queues)
    job_id = submit(job_queue)
    assert worker._take_interactive() == (job_id if taken else None)
    assert worker._take_interactive() is None
    submit(job_queue)
    worker._stop_requested = True
    assert worker._take_interactive() is None, "it is to end"


def test_a_forged_entry_is_refused_there_too(settings, job_queue, client):
    victim = submit(job_queue)
    client.hset(f"rq:job:{victim}", "data", '["os.mkdir", null, ["/nowhere"], {}]')
    assert WarmWorker(settings, "w")._take_interactive() is None
    assert job_queue.get(victim).problem.code == "refused"
