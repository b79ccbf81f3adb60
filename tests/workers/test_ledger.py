"""Every step of a job's record, from every state: each is taken once, or not at all."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import pytest
from dlo_client.contracts import JobState, NoopRequest, NoopResult

from tests.processes import KEYS
from workers import ledger as ledger_module
from workers import problems
from workers.ledger import Ledger
from workers.queue import JobQueue
from workers.record import Entry
from workers.steps import LONGEST_KEPT_REQUEST

RESULT = NoopResult(held_s=0.0)


@pytest.fixture
def no_grace(monkeypatch):
    monkeypatch.setattr(ledger_module, "GRACE_MS", 0)


def submit(job_queue, **fields):
    return job_queue.submit(NoopRequest(**fields))[0].id


def take(client, job_id):
    """As RQ does when it hands the id to a worker."""
    assert client.lrem("rq:queue:dlo:interactive", 0, job_id) == 1


def test_claim_says_what_to_do_and_can_be_had_once(job_queue, ledger):
    job_id = submit(job_queue, hold_s=0.5, timeout_s=30)
    claim = ledger.claim(job_id, "w")
    assert (claim.job_id, claim.attempt) == (job_id, 1)
    assert NoopRequest.model_validate_json(claim.request).hold_s == 0.5
    assert 20 < claim.remaining_s <= 30
    assert 0 <= claim.queue_wait_ms < 10_000
    assert ledger.claim(job_id, "w") is None
    job = job_queue.get(job_id)
    assert (job.state, job.attempts) == (JobState.RUNNING, 1)
    assert job.started_at >= job.created_at


def test_claim_of_what_is_not_there(ledger):
    assert ledger.claim("0" * 32, "w") is None


def test_a_job_ends_once(job_queue, ledger):
    claim = ledger.claim(submit(job_queue), "w")
    assert ledger.succeed(claim, RESULT, [], {"total": 1.0})
    assert not ledger.fail(claim, problems.timed_out())
    job = job_queue.cancel(claim.job_id)
    assert (job.state, job.result, job.problem) == (JobState.SUCCEEDED, RESULT, None)
    assert (job.progress, job.timings_ms) == (1.0, {"total": 1.0})
    assert job.ended_at >= job.started_at
    assert (job.expires_at - job.ended_at).total_seconds() == pytest.approx(3600)


def test_of_a_cancel_and_an_end_that_race_one_wins(job_queue, ledger):
    """Whatever the order, a job ends once, and who was told first was told the truth."""
    with ThreadPoolExecutor(2) as threads:
        for _ in range(50):
            claim = ledger.claim(submit(job_queue), "w")
            start = Barrier(2)

            def end(claim=claim, start=start):
                start.wait()
                return ledger.succeed(claim, RESULT, [], {})

            def cancel(claim=claim, start=start):
                start.wait()
                return job_queue.cancel(claim.job_id).state

            ended, told = threads.submit(end), threads.submit(cancel)
            final = JobState.SUCCEEDED if ended.result() else JobState.CANCELLED
            assert told.result() is final
            assert [event.state for event in job_queue.events(claim.job_id)][2:] == [final]


def test_what_a_cancelled_job_still_says_is_not_heard(job_queue, ledger):
    claim = ledger.claim(submit(job_queue), "w")
    job_queue.cancel(claim.job_id)
    assert ledger.renew(claim, "w") == "gone"
    ledger.progress(claim, 0.5)
    assert not ledger.succeed(claim, RESULT, [], {})
    assert ledger.lost(claim) is None
    job = job_queue.get(claim.job_id)
    assert (job.state, job.result, job.progress) == (JobState.CANCELLED, None, 0.0)


def test_the_worker_of_a_job_that_has_just_ended_well_does_not_lose_it(job_queue, ledger):
    """The child had written the result a moment before the worker renewed: it was killed as if by a
    cancel."""
    claim = ledger.claim(submit(job_queue), "w")
    assert ledger.succeed(claim, RESULT, [], {})
    assert ledger.renew(claim, "w") == "ended"
    assert ledger.renew(replace(claim, attempt=7), "w") == "gone", "another attempt ended well"
    assert job_queue.get(claim.job_id).state is JobState.SUCCEEDED


def test_a_cancelled_job_leaves_the_queue(job_queue, ledger):
    job_id = submit(job_queue, priority="batch")
    assert job_queue.depth() == {"interactive": 0, "batch": 1, "training": 0}
    assert job_queue.cancel(job_id).state is JobState.CANCELLED
    assert job_queue.depth() == {"interactive": 0, "batch": 0, "training": 0}
    assert ledger.claim(job_id, "w") is None


def test_a_late_job_is_dropped_and_says_so(job_queue, ledger):
    job_id = submit(job_queue, timeout_s=0.000_001)
    assert ledger.claim(job_id, "w") is None
    job = job_queue.get(job_id)
    assert (job.state, job.problem.code, job.attempts) == (JobState.FAILED, "deadline_exceeded", 0)


def test_a_lost_job_is_tried_once_more(job_queue, ledger, client):
    job_id = submit(job_queue)
    other = submit(job_queue)
    take(client, job_id)
    first = ledger.claim(job_id, "w")
    assert ledger.lost(first) == "requeued"
    assert client.lrange("rq:queue:dlo:interactive", 0, -1) == [job_id, other], (
        "before those who came later"
    )
    assert job_queue.get(job_id).state is JobState.QUEUED

    second = ledger.claim(job_id, "w")
    assert second.attempt == 2
    assert not ledger.succeed(first, RESULT, [], {}), "the first attempt has no say any more"
    assert ledger.lost(second) == "failed"
    job = job_queue.get(job_id)
    assert (job.state, job.problem.code, job.attempts) == (JobState.FAILED, "worker_lost", 2)


def test_reap_leaves_alone_what_waits_or_is_worked_on(job_queue, ledger, no_grace):
    waiting, running, over = (submit(job_queue) for _ in range(3))
    ledger.claim(running, "w")
    job_queue.cancel(over)
    for _ in range(2):
        assert [ledger.reap(job_id) for job_id in (waiting, running, over)] == [None, None, None]


def test_reap_takes_a_silent_running_job_after_the_grace(job_queue, ledger, client, no_grace):
    job_id = submit(job_queue)
    take(client, job_id)
    claim = ledger.claim(job_id, "w")
    client.delete(KEYS.alive(job_id))  # as by expiry
    assert ledger.reap(job_id) is None
    assert ledger.reap(job_id) == "requeued"
    assert ledger.renew(claim, "w") == "gone"
    assert job_queue.get(job_id).state is JobState.QUEUED


def test_reap_forgives_a_worker_that_speaks_up_in_the_grace(job_queue, ledger, client, no_grace):
    """Right after a restart of the queue server every liveness key has expired."""
    claim = ledger.claim(submit(job_queue), "w")
    for _ in range(2):
        client.delete(KEYS.alive(claim.job_id))
        assert ledger.reap(claim.job_id) is None
        assert ledger.renew(claim, "w") == "held"
        assert ledger.reap(claim.job_id) is None


def test_reap_brings_back_an_id_that_was_lost_between_queue_and_worker(
    job_queue, ledger, client, no_grace
):
    job_id = submit(job_queue)
    take(client, job_id)
    assert ledger.reap(job_id) is None
    assert ledger.reap(job_id) == "requeued"
    assert client.lrange("rq:queue:dlo:interactive", 0, -1) == [job_id]
    assert job_queue.get(job_id).attempts == 0


def test_reap_drops_a_late_job_although_no_worker_is_there(job_queue, ledger):
    job_id = submit(job_queue, timeout_s=0.000_001)
    assert ledger.reap(job_id) == "too late"
    assert job_queue.get(job_id).problem.code == "deadline_exceeded"


def test_a_finished_job_leaves_only_what_expires(settings, client):
    """The record, its events, the signal of its end and a tombstone, each with an expiry; nothing
    of RQ's."""
    queue, ledger = JobQueue(settings), Ledger(client, settings)
    claim = ledger.claim(submit(queue), "w")
    ledger.succeed(claim, RESULT, [], {})
    kept = {key: client.pttl(key) for key in client.scan_iter(f"*{claim.job_id}*")}
    assert sorted(key.split(":")[1] for key in kept) == ["ended", "events", "job", "tombstone"]
    assert all(ttl > 0 for ttl in kept.values())


def test_an_ended_job_no_longer_keeps_a_long_request(job_queue, ledger):
    """Ended jobs kept up to 4 MiB each in the memory of the queue server, for an hour."""
    long = replace(Entry.of(NoopRequest()), request="{}".rjust(LONGEST_KEPT_REQUEST + 1))
    done, cancelled, waiting = (job_queue.submit(long)[0].id for _ in range(3))
    short = submit(job_queue, label="short")
    for job_id in (done, short):
        ledger.succeed(ledger.claim(job_id, "w"), RESULT, [], {})
    job_queue.cancel(cancelled)
    assert [
        job_queue.request(job_id) is not None for job_id in (done, cancelled, waiting, short)
    ] == [0, 0, 1, 1]


def test_a_job_that_is_tried_again_still_has_its_request(job_queue, ledger):
    first = ledger.claim(submit(job_queue, hold_s=0.5), "w")
    ledger.lost(first)
    assert ledger.claim(first.job_id, "w").request == first.request
