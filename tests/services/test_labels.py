"""``/v1/labels`` and the jobs that learn from them: what is taken, what is refused, and who is
there to do it."""

from __future__ import annotations

import io
import zipfile
from datetime import UTC, datetime

import pytest

from services.examples import UPLOADS
from tests.services import samples
from workers import presence
from workers.presence import WorkerInfo, announce


def archive(count: int = 5, **other: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for k in range(count):
            made.writestr(f"{k}.png", samples.encoded())
            made.writestr(f"{k}_ids.png", samples.encoded(samples.pixels(mode="L")))
        for name, data in other.items():
            made.writestr(name.replace("__", "."), data)
    return out.getvalue()


def bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("zeros", bytes(50_000_000))
    return out.getvalue()


@pytest.fixture
def trainer(job_queue, monkeypatch):
    """A worker that trains, as the queue server sees it."""
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    info = WorkerInfo(
        "t", ready=True, busy=False, queues=["training"], started_at=datetime.now(UTC), networks=[]
    )
    announce(job_queue._client, job_queue._keys, info)


REFUSED = {
    "no archive": (b"text", "is no ZIP archive"),
    "too few": (archive(4), "holds 4 pictures with a label"),
    "a label alone": (archive(x_ids__png=b""), "x_ids.png has no picture beside it"),
    "a bomb": (bomb(), "unpacks to far more"),
}


@pytest.mark.parametrize(("data", "why"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_archive_of_labels_is_refused(client, problem, data, why):
    found = problem(client.post("/v1/labels", content=data), 422, "invalid_labels", "body")
    assert why in found["detail"]


def test_labels_are_kept_and_learnt_from_in_a_queue_of_their_own(client, trainer, job_queue):
    info = client.post("/v1/labels", content=archive()).json()
    assert info["pictures"] == 5
    job = client.post(
        "/v1/jobs", json={"kind": "adapt", "name": "cell7", "labels": {"id": info["id"]}}
    )
    assert job.status_code == 202, job.text
    assert job.json()["priority"] == "training"
    assert job_queue.depth() == {"interactive": 0, "batch": 0, "training": 1}


def test_without_a_worker_that_trains_nobody_waits_for_one(client, problem):
    """The job would have waited for its whole time limit."""
    labels = next(iter(UPLOADS))
    found = problem(
        client.post("/v1/jobs", json={"kind": "adapt", "name": "cell7", "labels": {"id": labels}}),
        503,
    )
    assert found["code"] == "no_training_worker"


def test_labels_that_were_never_uploaded_are_named(client, trainer, problem):
    request = {"kind": "adapt", "name": "cell7", "labels": {"id": "0" * 64}}
    problem(client.post("/v1/jobs", json=request), 422, "unknown_upload", "labels")


def test_a_worker_that_only_trains_makes_no_service_ready(client, trainer, problem):
    problem(client.get("/readyz"), 503, "not_ready")


WRONG = [
    ({"name": "A"}, "name"),
    ({"minutes": 0}, "minutes"),
    ({"minutes": 46}, "minutes"),
    ({"keep_aside": 0}, "keep_aside"),
]


@pytest.mark.parametrize(("fields", "field"), WRONG)
def test_numbers_and_names_are_checked(client, trainer, problem, fields, field):
    request = {"kind": "adapt", "name": "cell7", "labels": {"id": next(iter(UPLOADS))}}
    problem(client.post("/v1/jobs", json=request | fields), 422, "invalid_request", field)
