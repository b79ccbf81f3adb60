import itertools
import time
from types import SimpleNamespace

import pytest
from dlo_client.contracts import (
    JobState,
    MergeCurvesRequest,
    MergeCurvesResult,
    NoopRequest,
    NoopResult,
)
from dlo_client.contracts.frames import Output

from tests.clients import curve_samples
from workers import jobs
from workers.blobs import BlobsUnreachableError, FolderBlobs
from workers.connection import connect
from workers.ledger import Ledger
from workers.stages.outcome import InvalidInput, Outcome


@pytest.fixture
def ledger(settings):
    with connect(settings) as client:
        yield Ledger(client, settings)


@pytest.fixture
def tools(settings):
    """As much of Tools as jobs.run itself needs."""
    return SimpleNamespace(blobs=FolderBlobs(settings.blobs_dir, settings.blob_ttl_s))


@pytest.fixture
def run(job_queue, ledger, tools, monkeypatch):
    """Runs a job whose stage is the given function."""

    def run(stage, request=None):
        monkeypatch.setattr(jobs.stages, "run", stage)
        job, _ = job_queue.submit(request or NoopRequest(hold_s=0.25))
        jobs.run(ledger.claim(job.id, "w"), ledger, tools)
        return job_queue.get(job.id)

    return run


def test_the_outcome_becomes_result_files_and_timings(run, tools):
    def stage(request, tools):
        result = NoopResult(held_s=request.hold_s)
        return Outcome(result, {"mask.png": ("image/png", b"pixels")}, {"segment": 12.5})

    job = run(stage)
    assert (job.state, job.result) == (JobState.SUCCEEDED, NoopResult(held_s=0.25))
    [file] = job.files
    assert (file.name, file.media_type, file.bytes) == ("mask.png", "image/png", 6)
    assert tools.blobs.get(file.sha256) == b"pixels"
    assert job.timings_ms["segment"] == 12.5
    assert job.timings_ms["total"] >= job.timings_ms["queue_wait"] >= 0


def test_an_output_becomes_poses(run, job_queue):
    """Of a job that has places; a list of jobs leaves them out, as they can be many."""
    result = MergeCurvesResult(curve=curve_samples.straight(), disagreement_m=0.0, outliers=0)
    request = MergeCurvesRequest(curves=[curve_samples.straight()], output=Output(unit="mm"))
    job = run(lambda *_: Outcome(result), request)
    assert [pose.role for pose in job.poses.poses] == ["first", "middle", "last"]
    assert job.poses.poses[0].position == tuple(1000 * c for c in result.curve.points_m[0])
    assert job_queue.recent().jobs[0].poses is None


def test_the_requests_fault_names_the_field(run):
    def stage(request, tools):
        raise InvalidInput("views.1.image", "not a picture")

    problem = run(stage).problem
    assert (problem.code, problem.status) == ("invalid_image", 422)
    assert [(error.field, error.message) for error in problem.errors] == [
        ("views.1.image", "not a picture")
    ]


def test_our_fault_gets_an_incident_that_is_in_the_log(run, monkeypatch):
    lines = []

    class Log:
        def bind(self, **fields):
            return self

        def exception(self, event, **fields):
            lines.append(fields)

    def stage(request, tools):
        raise ZeroDivisionError("secret detail")

    monkeypatch.setattr(jobs, "log", Log())
    problem = run(stage).problem
    assert (problem.code, problem.status) == ("internal", 500)
    assert lines == [{"incident": problem.incident}]
    assert "secret" not in problem.model_dump_json()


def test_progress_is_told_but_not_every_hairs_breadth_nor_every_moment(run, job_queue, monkeypatch):
    def runs_at(seconds_a_call):
        calls = itertools.count()
        clock = SimpleNamespace(
            monotonic=lambda: seconds_a_call * next(calls), perf_counter=time.perf_counter
        )
        monkeypatch.setattr(jobs, "time", clock)

    runs_at(0.07)

    def stage(request, tools):
        for step in range(1001):
            tools.progress(step / 1000)
        return Outcome(NoopResult(held_s=0.0))

    told = [event.progress for event in job_queue.events(run(stage).id)][2:-1]
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0, abs=0.02)
    assert 80 <= len(told) <= 100  # every hundredth, that is every tenth step, .7 s

    runs_at(0.0001)
    assert [event.progress for event in job_queue.events(run(stage).id)][2:-1] == []


def test_pictures_that_cannot_be_reached_are_not_the_requests_fault_nor_internal(run):
    def stage(request, tools):
        raise BlobsUnreachableError("connection refused")

    problem = run(stage).problem
    assert (problem.code, problem.status) == ("storage_unavailable", 503)
