"""The real application over a real queue server, called without a network unless a test is about
that."""

from __future__ import annotations

import json
import socket
import threading
from datetime import UTC, datetime

import pytest
import uvicorn
from dlo_client.contracts import NetworkInfo
from starlette.testclient import TestClient

from services.app import create_app
from services.http_protocol import BoundedHttp
from services.settings import ServiceSettings
from tests.processes import KEYS, wait_until
from workers import presence
from workers.connection import connect
from workers.ledger import Ledger
from workers.presence import WorkerInfo


@pytest.fixture
def service_settings(settings) -> ServiceSettings:
    names = ("testserver", "service")  # what the clients of the tests call it
    return ServiceSettings(
        redis_url=settings.redis_url, data_dir=settings.data_dir, allowed_hosts=names
    )


@pytest.fixture(scope="session")
def document() -> dict:
    """The OpenAPI document; made once, for that takes half a second. No test changes it."""
    return create_app(ServiceSettings()).openapi()


@pytest.fixture
def app(service_settings):
    return create_app(service_settings)


@pytest.fixture
def client(app):
    """Errors of the service come back as the problems that a caller would see."""
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def problem(client):
    """Checks that a response is a problem of the given status and that the service goes on; returns
    it."""

    def check(response, status: int, code: str | None = None, field: str | None = None) -> dict:
        assert response.status_code == status, response.text
        assert response.headers["content-type"] == "application/problem+json"
        found = response.json()
        assert found["status"] == status
        assert found["title"]
        assert found["detail"]
        assert code in (None, found["code"])
        assert field is None or field in [error["field"] for error in found["errors"]], found
        assert client.get("/healthz").status_code == 200
        return found

    return check


@pytest.fixture
def ledger(job_queue, settings) -> Ledger:
    """For a test that does a worker's part by hand."""
    return Ledger(job_queue._client, settings)


@pytest.fixture
def address(app):
    """Of the application behind a real HTTP server on a port of its own."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        config = uvicorn.Config(
            app, http=BoundedHttp, log_config=None, access_log=False, timeout_graceful_shutdown=10
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        wait_until(lambda: server.started)
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        server.should_exit = True
        thread.join()


@pytest.fixture
def upload(client):
    def upload(data: bytes) -> dict[str, str]:
        return {"id": client.post("/v1/images", content=data).json()["id"]}

    return upload


@pytest.fixture
def send(client):
    """Multipart: the request, its `image` parts in order, perhaps a `mask` part."""

    def send(
        request: dict | None, *images: bytes, mask: bytes | None = None, depth: bytes | None = None
    ):
        files = [("image", ("picture", image)) for image in images]
        files += [("mask", ("mask", mask))] if mask is not None else []
        files += [("depth", ("depth", depth))] if depth is not None else []
        files += [("request", (None, json.dumps(request)))] if request is not None else []
        return client.post("/v1/jobs", files=files)

    return send


@pytest.fixture
def announced(settings, monkeypatch):
    """A worker that has one foreground network and one for another task; it is there for the whole
    test."""
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    fields = dict.fromkeys(("version", "sha256", "input", "origin", "license"), "1") | {
        "bytes": 1,
        "parameters": 1,
    }
    networks = [
        NetworkInfo(name=name, task=task, default=True, **fields)
        for name, task in (("foreground_compact", "foreground"), ("topology", "topology"))
    ]
    info = WorkerInfo(
        "w", ready=False, busy=True, queues=[], started_at=datetime.now(UTC), networks=networks
    )
    with connect(settings) as queue_server:
        presence.announce(queue_server, KEYS, info)
