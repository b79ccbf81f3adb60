"""Several replicas of the service without state, on hosts that share no folder: pictures are in a
bucket."""

from __future__ import annotations

import pytest
from dlo_client.contracts import FileRef, NoopResult
from starlette.testclient import TestClient

from services.app import create_app
from tests.services import samples
from workers.blobs import open_blobs

BUCKET = {"blobs_url": "s3://pictures/plant"}


@pytest.fixture
def replicas(service_settings, s3, tmp_path):
    """Two, each with a data folder of its own."""
    settings = [
        service_settings.model_copy(update=BUCKET | {"data_dir": tmp_path / name}) for name in "ns"
    ]
    north, south = (TestClient(create_app(one), raise_server_exceptions=False) for one in settings)
    with north, south:
        yield north, south


@pytest.fixture
def elsewhere(settings, s3):
    """The blobs as a third host sees them."""
    return open_blobs(settings.model_copy(update=BUCKET))


def test_a_picture_sent_to_one_reaches_a_worker_elsewhere_whose_files_the_other_answers(
    replicas, ledger, elsewhere
):
    north, south = replicas
    image = north.post("/v1/images", content=samples.encoded()).json()
    job = south.post("/v1/jobs", json={"kind": "segment", "image": {"id": image["id"]}})
    assert job.status_code == 202, job.text
    assert elsewhere.get(image["id"]) == samples.encoded()
    claim = ledger.claim(job.json()["id"], "third host")
    mask = FileRef(name="mask.png", media_type="image/png", bytes=4, sha256=elsewhere.put(b"mask"))
    assert ledger.succeed(claim, NoopResult(held_s=0.0), [mask], {})
    answer = north.get(f"/v1/jobs/{claim.job_id}/files/mask.png")
    assert (answer.content, answer.headers["content-type"]) == (b"mask", "image/png")


def test_the_idempotency_key_of_one_is_known_to_the_other(replicas):
    jobs = [
        one.post("/v1/jobs", json={"kind": "noop"}, headers={"Idempotency-Key": "k"}).json()
        for one in replicas
    ]
    assert jobs[0]["id"] == jobs[1]["id"]


def test_a_replica_whose_bucket_is_another_is_not_ready(replicas, service_settings):
    other = service_settings.model_copy(update={"blobs_url": "s3://nowhere"})
    with TestClient(create_app(other), raise_server_exceptions=False) as client:
        answer = client.get("/readyz")
        assert answer.status_code == 503
        assert "s3://nowhere" in answer.json()["detail"]
        refused = client.post("/v1/images", content=samples.encoded())
        assert (refused.status_code, refused.json()["code"]) == (503, "storage_unavailable")
        assert refused.headers["Retry-After"]


def test_nothing_of_a_picture_is_kept_on_the_disk_of_a_replica(replicas, tmp_path):
    for one in replicas:
        one.post("/v1/images", content=samples.encoded())
    assert list(tmp_path.rglob("??/*")) == []
