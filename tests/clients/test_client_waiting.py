"""Both clients: waiting for a job, and its events."""

from __future__ import annotations

import httpx
import pytest
from dlo_client import (
    ConnectionFailed,
    InvalidArgument,
    JobCancelled,
    JobFailed,
    NoopRequest,
    NoopResult,
    WaitTimeout,
    errors,
)
from dlo_client.contracts import JobState

from tests.clients import samples
from tests.clients.conftest import Connect
from tests.clients.replies import Breaking, Script, event, ok, refusal, reply

QUEUED = samples.job(JobState.QUEUED)
LOST = httpx.ConnectError("no route")


def test_wait_asks_again_until_the_job_ends(connect: Connect) -> None:
    script = Script(ok(samples.job(JobState.RUNNING)), ok(samples.job()))
    job = connect(script).wait(QUEUED, timeout=200)
    assert job.state is JobState.SUCCEEDED
    waits = [float(request.url.params["wait"]) for request in script.requests]
    assert waits == [60.0, 60.0]


def test_wait_ends_in_time(connect: Connect) -> None:
    with pytest.raises(WaitTimeout, match="still running after") as caught:
        connect(Script(ok(samples.job(JobState.RUNNING)))).wait(QUEUED, timeout=0.12)
    assert caught.value.job.state is JobState.RUNNING


@pytest.mark.parametrize("timeout", [0.12, 0, 0.0])
def test_a_run_that_takes_too_long_names_the_time_it_was_given(
    connect: Connect, timeout: float
) -> None:
    """It named what was left of that time at the last look: "after -0.0159 s"."""
    script = Script(ok(QUEUED, 202), ok(samples.job(JobState.RUNNING)))
    with pytest.raises(WaitTimeout, match=f"after {timeout:g} s$"):
        connect(script).run(NoopRequest(), timeout=timeout)


@pytest.mark.parametrize("timeout", [-1, float("nan"), "5", None])
def test_what_is_no_time_to_wait_is_refused(connect: Connect, timeout: object) -> None:
    client = connect(Script(LOST))
    with pytest.raises(InvalidArgument, match=r"^timeout: .* is no number of seconds"):
        client.wait(QUEUED, timeout=timeout)
    if timeout is not None:
        with pytest.raises(InvalidArgument, match=r"^timeout"):
            client.run(NoopRequest(), timeout=timeout)


def test_no_pause_outlasts_the_wait(connect: Connect) -> None:
    """A retry's pause once could be far longer than the time the caller gave."""
    script = Script(refusal(samples.refused(503), {"Retry-After": "15"}))
    with pytest.raises(errors.ServiceFault):
        connect(script).wait(QUEUED, timeout=1)
    assert len(script.requests) == 1


def test_a_finished_job_needs_no_wait(connect: Connect) -> None:
    done = samples.job()
    assert connect(Script(LOST)).wait(done) is done


def test_run_gives_the_result_and_run_job_the_job(connect: Connect) -> None:
    script = Script(ok(QUEUED, 202), ok(samples.job()))
    assert connect(script).run(NoopRequest(timeout_s=5)) == NoopResult(held_s=0.0)
    assert connect(Script(ok(samples.job()))).run_job(NoopRequest()).result == NoopResult(
        held_s=0.0
    )
    assert 14 < float(script.requests[0].url.params["wait"]) <= 15


def test_run_raises_the_problem_of_a_failed_job(connect: Connect) -> None:
    problem = samples.refused(422, code="invalid_image")
    with pytest.raises(JobFailed, match="it was refused") as caught:
        connect(Script(ok(samples.failed(problem)))).run(NoopRequest())
    assert caught.value.problem.code == "invalid_image"


def test_run_raises_for_a_cancelled_job(connect: Connect) -> None:
    with pytest.raises(JobCancelled):
        connect(Script(ok(samples.job(JobState.CANCELLED)))).run(NoopRequest())


def test_events_end_with_the_job(connect: Connect) -> None:
    stream = ": ping\n\n" + event(1) + event(2, JobState.SUCCEEDED, 1.0)
    events = list(connect(Script(reply(200, text=stream))).events("abc"))
    assert [(found.id, found.state) for found in events] == [
        ("1-0", "running"),
        ("2-0", "succeeded"),
    ]


def test_a_broken_stream_goes_on_after_the_last_event(connect: Connect) -> None:
    half_an_event = event(3)[:20]
    script = Script(
        reply(200, stream=Breaking(event(1) + event(2) + half_an_event)),
        LOST,
        reply(200, text=event(3)),
        reply(200, text=event(4, JobState.SUCCEEDED)),
    )
    events = list(connect(script).events("abc"))
    assert [found.id for found in events] == ["1-0", "2-0", "3-0", "4-0"]
    after = [request.headers.get("Last-Event-ID") for request in script.requests]
    assert after == [None, "2-0", "2-0", "3-0"]


def test_a_stream_that_never_moves_is_given_up(connect: Connect) -> None:
    script = Script(*(reply(200, stream=Breaking(": ping\n\n")) for _ in range(4)))
    with pytest.raises(ConnectionFailed, match="connection lost"):
        list(connect(script).events("abc"))
    assert len(script.requests) == 3


def test_events_of_an_expired_job_are_gone(connect: Connect) -> None:
    with pytest.raises(errors.Gone, match="it was refused"):
        list(connect(Script(refusal(samples.refused(410)))).events("abc"))
