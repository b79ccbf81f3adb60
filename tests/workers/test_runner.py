"""What becomes of a child while it is watched; the whole path is in tests/system."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from dlo_client.contracts import NoopRequest, NoopResult

from workers import problems
from workers.connection import connect
from workers.ledger import Ledger
from workers.runner import Runner


@pytest.fixture
def ledger(settings):
    with connect(settings) as client:
        yield Ledger(client, settings)


def watched(settings, ledger, claim, end, reports):
    """Whether the child goes on that has done ``end`` when its claim is looked at, and then
    ``reports`` or not."""
    answers = [lambda: end() or False, lambda: reports]
    child = SimpleNamespace(wait=lambda _: answers.pop(0)(), frozen=False)
    return Runner(settings, "w")._watch(child, claim)


@pytest.mark.parametrize("ends", ["succeed", "fail"])
def test_a_child_that_has_just_ended_its_job_goes_on(settings, job_queue, ledger, ends):
    """The claim is looked at five times a second: a job that ended between the look before and its
    report was taken for a cancelled one, and its child was killed."""
    claim = ledger.claim(job_queue.submit(NoopRequest())[0].id, "w")

    def end() -> None:
        if ends == "succeed":
            ledger.succeed(claim, NoopResult(held_s=0.0), [], {})
        else:
            ledger.fail(claim, problems.too_large())

    assert watched(settings, ledger, claim, end, reports=True)


def test_a_child_whose_job_was_cancelled_is_stopped(settings, job_queue, ledger):
    claim = ledger.claim(job_queue.submit(NoopRequest())[0].id, "w")
    assert not watched(
        settings, ledger, claim, lambda: job_queue.cancel(claim.job_id) and None, reports=True
    )


def test_a_child_at_work_on_a_job_that_a_reaper_has_ended_is_stopped(settings, job_queue, ledger):
    claim = ledger.claim(job_queue.submit(NoopRequest())[0].id, "w")
    ledger.lost(claim)
    last = ledger.claim(claim.job_id, "other")
    assert not watched(settings, ledger, claim, lambda: None, reports=True), "taken over"
    assert not watched(settings, ledger, last, lambda: ledger.lost(last) and None, reports=False), (
        "no attempt is left"
    )
