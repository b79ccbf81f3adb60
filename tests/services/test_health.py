"""Probes, models and metrics."""

import re
from datetime import UTC, datetime

import dlo_client
import pytest
from dlo_client.contracts import NetworkInfo
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from services.app import create_app
from tests.processes import wait_until
from workers import presence

NETWORK = NetworkInfo(
    name="net",
    version="1",
    task="foreground",
    default=True,
    sha256="0" * 64,
    bytes=1,
    parameters=1,
    input="RGB",
    origin="here",
    license="Apache-2.0",
)


def test_the_version_is_that_of_the_sdk(client):
    assert client.get("/version").json() == {"version": dlo_client.__version__}
    assert client.get("/openapi.json").json()["info"]["version"] == dlo_client.__version__


@pytest.fixture
def announce(job_queue):
    """A worker says that it is there."""

    def announce(*, ready: bool, busy: bool = False, name: str = "w1") -> None:
        info = presence.WorkerInfo(name, ready, busy, ["interactive"], datetime.now(UTC), [NETWORK])
        presence.announce(job_queue._client, job_queue._keys, info)

    return announce


@pytest.fixture
def without_queue(service_settings):
    """A service whose queue server is not there."""
    settings = service_settings.model_copy(update={"redis_url": "redis://127.0.0.1:1/0"})
    with TestClient(create_app(settings), raise_server_exceptions=False) as client:
        yield client


def test_ready_only_once_a_worker_is(client, problem, announce):
    waiting = client.get("/readyz")
    problem(waiting, 503, "not_ready")
    assert waiting.headers["Retry-After"]
    announce(ready=False)
    problem(client.get("/readyz"), 503, "not_ready")
    announce(ready=True)
    assert client.get("/readyz").json() == {"status": "ok"}


def test_alive_but_not_ready_without_the_queue(without_queue):
    assert without_queue.get("/healthz").status_code == 200
    response = without_queue.get("/readyz")
    assert (response.status_code, response.json()["code"]) == (503, "not_ready")


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/models", "/v1/jobs/" + "0" * 32, "/metrics"])
def test_without_the_queue_it_asks_to_come_back(without_queue, path):
    response = without_queue.get(path)
    assert (response.status_code, response.json()["code"]) == (503, "queue_unavailable")
    assert response.headers["Retry-After"]


def test_models_are_those_of_ready_workers(client, announce):
    assert client.get("/v1/models").json() == []
    announce(ready=True)
    assert client.get("/v1/models").json() == [NETWORK.model_dump()]


def test_metrics(client, announce):
    announce(ready=True, name="w1")
    announce(ready=True, busy=True, name="w2")
    client.post("/v1/jobs", json={"kind": "noop"})
    cancelled = client.post("/v1/jobs", json={"kind": "noop"}).json()["id"]
    client.delete(f"/v1/jobs/{cancelled}")
    client.post("/v1/jobs", json={"kind": "noop", "priority": "batch"})
    client.get("/v1/jobs/" + "0" * 32)
    client.get("/no/such/path")
    samples = {
        (sample.name, *sorted(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(client.get("/metrics").text)
        for sample in family.samples
        if not sample.name.endswith("_bucket")
    }
    assert samples["dlo_queue_depth", "interactive"] == samples["dlo_queue_depth", "batch"] == 1
    assert samples["dlo_workers", "idle"] == samples["dlo_workers", "busy"] == 1
    assert samples["dlo_jobs_total", "noop", "queued"] == 3
    assert samples["dlo_jobs_total", "cancelled", "noop"] == 1
    count = "dlo_http_request_seconds_count"
    assert samples[count, "/v1/jobs", "2xx", "POST"] == 3
    assert samples[count, "/v1/jobs/{job_id}", "4xx", "GET"] == 1
    assert samples[count, "4xx", "GET", "none"] == 1


def test_the_documentation_page_needs_no_network(client):
    """It loaded its script from elsewhere, and was blank in a cell without internet."""
    page = client.get("/docs").text
    sources = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert sources
    assert not [source for source in sources if "//" in source]
    assert all(client.get(source).status_code == 200 for source in sources)


@pytest.mark.slow
def test_a_job_whose_last_worker_is_gone_is_put_right_by_the_service(client, ledger, job_queue):
    """Nobody but a worker looked after lost jobs: with the last one killed, its job was running for
    ever."""
    job_id = client.post("/v1/jobs", json={"kind": "noop", "timeout_s": 600}).json()["id"]
    for _ in range(2):
        assert wait_until(lambda: ledger.claim(job_id, "gone"), 20)
        job_queue._client.delete(job_queue._keys.alive(job_id))
        wait_until(lambda: client.get(f"/v1/jobs/{job_id}").json()["state"] != "running", 20)
    job = client.get(f"/v1/jobs/{job_id}").json()
    assert job["state"] == "failed"
    assert job["problem"]["code"] == "worker_lost"


def test_metrics_tell_how_full_the_disk_is(client, service_settings):
    families = {
        f.name: f.samples[0].value
        for f in text_string_to_metric_families(client.get("/metrics").text)
        if f.samples
    }
    assert 0 < families["dlo_disk_free_bytes"] <= families["dlo_disk_bytes"]
    assert families["dlo_disk_reserve_bytes"] == service_settings.disk_reserve_bytes
