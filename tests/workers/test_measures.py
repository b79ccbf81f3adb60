"""What is counted of jobs."""

from __future__ import annotations

import pytest
from dlo_client.contracts import NoopRequest, NoopResult

from tests.processes import KEYS
from workers import problems
from workers.connection import connect
from workers.ledger import Ledger
from workers.measures import Observed
from workers.record import Origin


@pytest.fixture
def ledger(settings):
    with connect(settings) as client:
        yield Ledger(client, settings)


@pytest.fixture
def claim(job_queue, ledger):
    """A running job of an owner."""

    def claim(owner="", **fields):
        job, _ = job_queue.submit(NoopRequest(**fields), origin=Origin(owner))
        return ledger.claim(job.id, "w")

    return claim


def test_waiting_and_running_and_each_stage_are_observed(job_queue, ledger, claim):
    for _ in range(3):
        ledger.succeed(
            claim(), NoopResult(held_s=0), [], {"decode": 20.0, "queue_wait": 1.0, "total": 21.0}
        )
    found = job_queue.measures().histograms
    assert set(found) == {
        ("wait", "interactive"),
        ("run", "noop", "succeeded"),
        ("stage", "noop", "decode"),
    }
    decode = found["stage", "noop", "decode"]
    assert decode.counts == {"0.025": 3}
    assert decode.sum_s == pytest.approx(0.06)
    assert sum(found["wait", "interactive"].counts.values()) == 3


def test_failures_are_counted_by_reason(job_queue, ledger, claim):
    ledger.fail(claim(), problems.too_large())
    ledger.fail(claim(), problems.invalid("image", "no", "invalid_image"))
    job_queue.cancel(claim().job_id)
    counters = job_queue.measures().counters
    assert (
        counters["failed", "noop", "too_large"] == counters["failed", "noop", "invalid_image"] == 1
    )
    assert ("failed", "noop", "cancelled") not in counters
    assert job_queue.measures().histograms["run", "noop", "cancelled"].counts


def test_jobs_are_counted_by_owner_and_retries_by_kind(job_queue, ledger, claim):
    first = claim("cell-3")
    ledger.lost(first)
    ledger.succeed(ledger.claim(first.job_id, "w"), NoopResult(held_s=0), [], {})
    counters = job_queue.measures().counters
    assert counters["owner", "cell-3", "succeeded"] == 1
    assert counters["owner_seconds", "cell-3"] >= 0
    assert counters["retried", "noop"] == 1


def test_a_job_that_never_ran_was_not_running(job_queue, claim):
    job, _ = job_queue.submit(NoopRequest())
    job_queue.cancel(job.id)
    assert job_queue.measures().histograms == {}
    assert job_queue.measures().counters == {("owner", "", "cancelled"): 1}


def test_the_age_of_the_oldest_job(job_queue, settings):
    assert job_queue.oldest_s() == {"interactive": 0.0, "batch": 0.0, "training": 0.0}
    old, _ = job_queue.submit(NoopRequest(priority="batch"))
    job_queue.submit(NoopRequest(priority="batch"))
    with connect(settings) as client:
        seconds, _ = client.time()
        client.zadd(KEYS.waiting("batch"), {old.id: seconds - 90})
    assert job_queue.oldest_s()["batch"] == pytest.approx(90, abs=5)
    job_queue.cancel(old.id)
    assert job_queue.oldest_s()["batch"] < 60


def test_buckets_are_cumulative():
    assert Observed({"0.005": 2, "0.1": 1, "+Inf": 1}).cumulative()[-1] == ("+Inf", 4.0)
    assert dict(Observed({"0.005": 2, "0.1": 1}).cumulative())["0.05"] == 2
