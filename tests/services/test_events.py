"""``GET /v1/jobs/{id}/events``."""

import threading

import pytest
from dlo_client.contracts import JobEvent, NoopResult


@pytest.fixture
def noop(client) -> str:
    return client.post("/v1/jobs", json={"kind": "noop"}).json()["id"]


def read(client, job_id: str, after: str | None = None) -> list[JobEvent]:
    """The events until the stream ends; each line is as the standard has it."""
    headers = {"Last-Event-ID": after} if after else {}
    with client.stream("GET", f"/v1/jobs/{job_id}/events", headers=headers) as response:
        assert response.status_code == 200, response.read()
        assert response.headers["content-type"].startswith("text/event-stream")
        lines = [line for line in response.iter_lines() if line and not line.startswith(":")]
    events = [JobEvent.model_validate_json(line[6:]) for line in lines if line.startswith("data: ")]
    assert [line[4:] for line in lines if line.startswith("id: ")] == [event.id for event in events]
    return events


def finish(ledger, job_id: str) -> None:
    claim = ledger.claim(job_id, "by hand")
    ledger.progress(claim, 0.5)
    ledger.succeed(claim, NoopResult(held_s=0), [], {})


def test_tells_states_and_progress_and_ends(client, noop, ledger):
    finish(ledger, noop)
    told = [(event.state.value, event.progress) for event in read(client, noop)]
    assert told == [("queued", 0), ("running", 0), ("running", 0.5), ("succeeded", 1)]


def test_follows_a_job_that_goes_on(client, noop, ledger):
    worker = threading.Timer(0.2, finish, [ledger, noop])
    worker.start()
    assert read(client, noop)[-1].state == "succeeded"
    worker.join()


def test_cancelling_ends_it(client, noop):
    client.delete(f"/v1/jobs/{noop}")
    assert [event.state for event in read(client, noop)] == ["queued", "cancelled"]


def test_resumes_after_the_last_event_seen(client, noop, ledger):
    finish(ledger, noop)
    every = read(client, noop)
    for seen in range(len(every)):
        assert read(client, noop, after=every[seen].id) == every[seen + 1 :]


def test_last_event_id_out_of_form(client, problem, noop):
    response = client.get(f"/v1/jobs/{noop}/events", headers={"Last-Event-ID": "latest"})
    problem(response, 422, field="Last-Event-ID")
