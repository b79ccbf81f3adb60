from datetime import UTC, datetime

from dlo_client.contracts import (
    ImagePart,
    ImageRef,
    InstancesRequest,
    JobState,
    NoopRequest,
    NoopResult,
    SegmentRequest,
)

from workers.record import pictures, read_event, read_job

ID_A, ID_B = "a" * 64, "b" * 64


def test_pictures_finds_every_uploaded_picture():
    request = InstancesRequest(image=ImageRef(id=ID_A), mask=ImageRef(id=ID_B))
    assert sorted(pictures(request)) == [ID_A, ID_B]
    assert pictures(SegmentRequest(image=ImagePart(part=0))) == []
    assert pictures(NoopRequest()) == []


def test_read_job_of_a_finished_record():
    record = {
        "id": "0123",
        "kind": "noop",
        "priority": "batch",
        "label": "",
        "state": "succeeded",
        "progress": "1",
        "attempts": "2",
        "created_at": "1700000000.250000",
        "ended_at": "1700000001.000000",
        "request": "{}",
        "deadline": "1700000060",
        "result": '{"kind": "noop", "held_s": 0.5}',
        "timings_ms": '{"total": 750.0}',
    }
    job = read_job(record)
    assert job.created_at == datetime(2023, 11, 14, 22, 13, 20, 250_000, tzinfo=UTC)
    assert (job.state, job.priority, job.label, job.attempts) == (
        JobState.SUCCEEDED,
        "batch",
        None,
        2,
    )
    assert job.result == NoopResult(held_s=0.5)
    assert job.timings_ms == {"total": 750.0}
    assert (job.started_at, job.problem) == (None, None)


def test_read_event():
    event = read_event("7-0", {"state": "running", "progress": "0.2500"})
    assert (event.id, event.state, event.progress) == ("7-0", JobState.RUNNING, 0.25)
