"""What reaches the disk: only pictures of requests that are accepted, and only while there is
room."""

import errno
import json
from pathlib import Path

import pytest

from tests.services import samples
from workers.blobs import FolderBlobs


@pytest.fixture
def stored(service_settings):
    """Every blob, whole or half written."""
    return lambda: list(service_settings.blobs_dir.glob("??/*"))


@pytest.fixture
def send(client):
    def send(request: dict, *images: bytes):
        files = [("image", ("picture", image)) for image in images]
        return client.post("/v1/jobs", files=[*files, ("request", (None, json.dumps(request)))])

    return send


@pytest.fixture
def full_queue(app, settings, monkeypatch):
    small = settings.model_copy(update={"max_queue_depth": 1})
    monkeypatch.setattr(app.state.backend.queue, "_settings", small)


@pytest.fixture
def full_disk(monkeypatch):
    monkeypatch.setattr(FolderBlobs, "free_bytes", lambda _: 100)


def test_pictures_of_an_accepted_request_are_kept(send, stored):
    assert send({"kind": "segment"}, samples.encoded()).status_code == 202
    assert len(stored()) == 1


@pytest.mark.parametrize(
    "request_fields", [{"kind": "knot"}, {"kind": "noop"}, {"kind": "segment", "threshold": 2}]
)
def test_pictures_of_a_refused_request_are_dropped(send, stored, problem, request_fields):
    problem(send(request_fields, samples.encoded()), 422)
    assert stored() == []


def test_a_refused_request_does_not_drop_a_picture_that_was_there(client, send, stored, problem):
    client.post("/v1/images", content=samples.encoded())
    problem(send({"kind": "knot"}, samples.encoded()), 422)
    assert len(stored()) == 1


def test_no_picture_is_kept_for_a_full_queue(client, send, stored, problem, full_queue):
    """They were stored first: a queue that refused everything filled the disk."""
    assert client.post("/v1/jobs", json={"kind": "noop"}).status_code == 202
    problem(send({"kind": "segment"}, samples.encoded()), 429, "queue_full")
    assert stored() == []


def test_a_queue_that_fills_up_meanwhile_keeps_no_picture(
    app, client, send, stored, problem, full_queue, monkeypatch
):
    client.post("/v1/jobs", json={"kind": "noop"})
    monkeypatch.setattr(app.state.backend.queue, "check_room", lambda *_: None)
    problem(send({"kind": "segment"}, samples.encoded()), 429, "queue_full")
    assert stored() == []


def test_a_repeated_submission_is_answered_although_the_queue_is_full(client, full_queue):
    first, second = (
        client.post("/v1/jobs", json={"kind": "noop"}, headers={"Idempotency-Key": "k"})
        for _ in range(2)
    )
    assert second.status_code == 202
    assert second.json()["id"] == first.json()["id"]


def test_below_the_reserve_uploads_are_refused(client, send, stored, problem, full_disk):
    """The disk was filled to its end: 500, half a blob, and the queue server could not write its
    log."""
    refused = client.post("/v1/images", content=samples.encoded())
    problem(refused, 507, "storage_full")
    assert refused.headers["Retry-After"]
    problem(send({"kind": "segment"}, samples.encoded()), 507, "storage_full")
    assert stored() == []
    assert client.post("/v1/jobs", json={"kind": "noop"}).status_code == 202


def test_a_disk_that_is_full_all_the_same_leaves_nothing_half_written(
    client, stored, problem, monkeypatch
):
    def half(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", half)
    problem(client.post("/v1/images", content=samples.encoded()), 507, "storage_full")
    assert stored() == []
