"""``/v1/models``: bring a network, choose a version, take its file elsewhere, delete it; whose it
is."""

from __future__ import annotations

import threading
from datetime import UTC, datetime

import pytest
from dlo_client.contracts import NetworkInfo
from starlette.testclient import TestClient

from models.weights.inference import Runtime
from services.app import create_app
from tests.processes import wait_until
from tests.services.test_keys import as_, entry
from tests.workers.networks import tiny
from workers import jobs, presence
from workers.blobs import FolderBlobs
from workers.connection import connect
from workers.ledger import Ledger
from workers.networks.store import NetworkStore
from workers.presence import WorkerInfo, announce
from workers.stages.outcome import Tools

SHIPPED = NetworkInfo(
    name="foreground_compact",
    version="1",
    task="foreground",
    default=True,
    sha256="0" * 64,
    bytes=1,
    parameters=1,
    input="",
    origin="",
    license="",
)


@pytest.fixture
def working(settings, job_queue):
    """A worker's part, done by a thread: it runs every job that is queued."""
    tools = Tools(
        FolderBlobs(settings.blobs_dir, settings.blob_ttl_s),
        10**7,
        Runtime(threads=1),
        store=NetworkStore.of(settings),
    )
    stop = threading.Event()

    def work() -> None:
        with connect(settings) as client:
            ledger = Ledger(client, settings)
            while not stop.wait(0.02):
                for job_id in client.smembers(settings.keys.active):
                    if claim := ledger.claim(job_id, "w"):
                        jobs.run(claim, ledger, tools)

    thread = threading.Thread(target=work)
    thread.start()
    yield
    stop.set()
    thread.join()


@pytest.fixture
def announced(job_queue, monkeypatch):
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    info = WorkerInfo(
        "w", ready=True, busy=False, queues=[], started_at=datetime.now(UTC), networks=[SHIPPED]
    )
    announce(job_queue._client, job_queue._keys, info)


def names(client, **headers) -> list[str]:
    return [network["name"] for network in client.get("/v1/models", **headers).json()]


def test_a_network_goes_its_whole_way(client, working, announced):
    made = client.post("/v1/models", content=tiny.packed())
    assert made.status_code == 201, made.text
    assert (made.json()["name"], made.json()["version"], made.json()["shipped"]) == (
        "cell7",
        "1",
        False,
    )
    assert (
        client.post("/v1/models", content=tiny.packed(tiny.brightness(9.0))).json()["version"]
        == "1"
    )
    assert client.put("/v1/models/cell7", json={"version": 2}).json()["version"] == "2"
    assert names(client) == ["foreground_compact", "cell7"]
    file = client.get("/v1/models/cell7/file", params={"version": 1})
    assert file.content == tiny.packed()
    assert (
        client.post("/v1/models", params={"name": "copy"}, content=file.content).json()["name"]
        == "copy"
    )
    assert client.delete("/v1/models/cell7", params={"version": 1}).status_code == 204
    assert [v["version"] for v in client.get("/v1/models/cell7").json()["versions"]] == [2]
    assert client.delete("/v1/models/cell7").status_code == 204
    assert names(client) == ["foreground_compact", "copy"]


def test_a_request_may_name_a_network_as_soon_as_it_is_there(client, working, announced, problem):
    request = {"kind": "instances", "model": "cell7", "image": {"id": "0" * 64}}
    problem(client.post("/v1/jobs", json=request), 422, "invalid_model", "model")
    client.post("/v1/models", content=tiny.packed())
    problem(client.post("/v1/jobs", json=request), 422, "unknown_image", "image")
    problem(
        client.post("/v1/jobs", json=request | {"model": "cell7@2"}), 422, "invalid_model", "model"
    )


def test_what_is_no_network_is_refused_and_says_so(client, working, problem):
    problem(client.post("/v1/models", content=b"nothing"), 422, "invalid_network", "body")
    problem(
        client.post("/v1/models", content=tiny.packed(tiny.brightness(outputs=2))),
        422,
        "invalid_network",
        "file",
    )
    problem(
        client.post("/v1/models", params={"name": "A B"}, content=tiny.packed()), 422, field="name"
    )
    problem(
        client.post("/v1/models", params={"name": "topology"}, content=tiny.packed()),
        422,
        "name_taken",
        "name",
    )


def test_what_is_not_there_or_ships_cannot_be_changed(client, announced, problem):
    for answer in (
        client.get("/v1/models/x"),
        client.get("/v1/models/x/file"),
        client.delete("/v1/models/x"),
        client.put("/v1/models/x", json={"version": 1}),
    ):
        problem(answer, 404, "unknown_network")
    problem(client.delete("/v1/models/foreground_compact"), 403, "forbidden")
    problem(client.put("/v1/models/foreground_compact", json={"version": 1}), 403, "forbidden")


def test_the_version_in_service_is_not_deleted_from_under_it(client, settings, problem):
    store, data = NetworkStore.of(settings), tiny.brightness()
    for _ in range(2):
        store.add(tiny.card(data), data, "cell7", "")
    problem(client.delete("/v1/models/cell7", params={"version": 1}), 409, "in_service")


def test_a_body_that_is_too_large_is_not_read(service_settings, settings):
    small = service_settings.model_copy(update={"max_network_bytes": 1000})
    with TestClient(create_app(small), raise_server_exceptions=False) as client:
        assert client.post("/v1/models", content=bytes(200_000)).status_code == 413


@pytest.fixture
def keyed(service_settings, tmp_path):
    file = tmp_path / "keys.toml"
    keys = [entry("cell", model="cell7"), entry("other"), entry("chief", scopes=["admin"])]
    file.write_text("\n".join(keys))
    with TestClient(
        create_app(service_settings.model_copy(update={"api_keys_file": file}))
    ) as client:
        yield client


def test_a_network_is_anybodys_to_use_and_its_owners_to_change(keyed, settings, announced):
    store, data = NetworkStore.of(settings), tiny.brightness()
    for _ in range(3):
        store.add(tiny.card(data), data, "cell7", "cell")
    assert names(keyed, headers=as_("other")) == ["foreground_compact", "cell7"]
    for method, path, body in (
        ("PUT", "", {"version": 2}),
        ("DELETE", "", None),
        ("GET", "/file", None),
    ):
        refused = keyed.request(method, f"/v1/models/cell7{path}", json=body, headers=as_("other"))
        assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
    assert keyed.get("/v1/models/cell7/file", headers=as_("cell")).status_code == 200
    assert (
        keyed.put("/v1/models/cell7", json={"version": 2}, headers=as_("chief")).json()["version"]
        == "2"
    )


def test_a_key_has_a_default_network_of_its_own(keyed, settings, announced, job_queue):
    store, data = NetworkStore.of(settings), tiny.brightness()
    store.add(tiny.card(data), data, "cell7", "cell")
    image = keyed.post("/v1/images", content=_png(), headers=as_("cell")).json()["id"]
    asked = {"kind": "segment", "image": {"id": image}}
    found = {}
    for name in ("cell", "other"):
        job = keyed.post("/v1/jobs", json=asked, headers=as_(name)).json()["id"]
        request = job_queue._client.hget(f"dlo:job:{job}", "request")
        found[name] = '"default_model":"cell7"' in request
        listed = keyed.get("/v1/models", headers=as_(name)).json()
        assert {n["name"]: n["default"] for n in listed} == {
            "foreground_compact": name == "other",
            "cell7": name == "cell",
        }
    assert found == {"cell": True, "other": False}


def _png() -> bytes:
    from tests.services import samples

    return samples.encoded()


def test_nobody_checks_a_network_while_no_worker_is_there(client, monkeypatch, problem):
    from services.routes import models

    monkeypatch.setattr(models, "_CHECKED_WITHIN_S", 0.1)
    answer = client.post("/v1/models", content=tiny.packed())
    problem(answer, 504, "not_checked_yet")
    assert wait_until(lambda: client.get(answer.headers["Location"]).json()["state"] == "queued", 5)
