"""Without keys: this machine only, and no web page from elsewhere. With and without: what browsers
are told."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys

import httpx
import pytest
import uvicorn
from fastapi import FastAPI
from starlette.testclient import TestClient

from services import gate, http_protocol
from services.app import create_app
from services.exposure import _address, exposed
from services.http_protocol import BoundedHttp, connection_limit
from tests.processes import ROOT, wait_until
from tests.services.test_access import HASHES, KEY

OWN = ["127.0.0.1", "127.0.0.1:8000", "localhost:8000", "[::1]:8000", "viewer.localhost"]
FOREIGN = ["evil", "evil.example:8000", "192.168.1.5:8000", "localhost.evil.example", "", "[::1"]


@pytest.fixture
def strict(service_settings):
    """As it is without settings of the tests: no further host."""
    app = create_app(service_settings.model_copy(update={"allowed_hosts": ()}))
    with TestClient(app, raise_server_exceptions=False, base_url="http://127.0.0.1") as client:
        yield client


@pytest.fixture
def guarded(service_settings):
    settings = service_settings.model_copy(update={"api_key_hashes": HASHES, "allowed_hosts": ()})
    with TestClient(create_app(settings), raise_server_exceptions=False) as client:
        client.headers["Authorization"] = f"Bearer {KEY}"
        yield client


@pytest.mark.parametrize("host", OWN)
def test_names_of_this_machine(strict, host):
    assert strict.get("/v1/jobs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("host", FOREIGN)
def test_a_name_that_leads_here_is_not_enough(strict, host):
    """`Host: evil` read the list of jobs: what a page does whose name is rebound to 127.0.0.1."""
    response = strict.get("/v1/jobs", headers={"Host": host})
    assert (response.status_code, response.json()["code"]) == (421, "foreign_host")


def test_a_name_that_the_operator_gave(service_settings):
    settings = service_settings.model_copy(update={"allowed_hosts": ("cell.example",)})
    with TestClient(create_app(settings), base_url="http://cell.example:8000") as client:
        assert client.get("/v1/jobs").status_code == 200
        assert client.get("/v1/jobs", headers={"Origin": "https://cell.example"}).status_code == 200


def test_with_keys_any_name_will_do(guarded):
    assert guarded.get("/v1/jobs", headers={"Host": "evil.example"}).status_code == 200


@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://127.0.0.1:9999", "http://[", ""]
)
def test_a_page_from_elsewhere_may_not_submit(strict, origin, job_queue):
    """Any web page could: a form's body needs no leave of the browser."""
    response = strict.post("/v1/jobs", json={"kind": "noop"}, headers={"Origin": origin})
    assert (response.status_code, response.json()["code"]) == (403, "foreign_origin")
    assert job_queue.depth()["interactive"] == 0


def test_our_own_page_may(strict):
    headers = {
        "Origin": "http://127.0.0.1:8000",
        "Host": "127.0.0.1:8000",
        "Sec-Fetch-Site": "same-origin",
    }
    assert strict.post("/v1/jobs", json={"kind": "noop"}, headers=headers).status_code == 202


@pytest.mark.parametrize(
    ("method", "mode", "status"), [("GET", "navigate", 200), ("GET", "no-cors", 403)]
)
def test_a_link_may_lead_here_but_no_page_may_embed_us(strict, method, mode, status):
    headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": mode}
    assert strict.request(method, "/", headers=headers).status_code == status


@pytest.mark.parametrize(
    ("address", "status"), [("127.0.0.1", 200), ("192.168.1.5", 403), ("::ffff:10.0.0.1", 403)]
)
def test_what_comes_in_from_a_network_is_refused_without_keys(service_settings, address, status):
    app = create_app(service_settings.model_copy(update={"allowed_hosts": ("cell",)}))

    async def arriving(scope, receive, send):
        await app(scope | {"server": (address, 8000)}, receive, send)

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(arriving), base_url="http://cell"
        ) as client:
            return await client.get("/healthz")

    assert asyncio.run(ask()).status_code == status


@pytest.mark.system
def test_uvicorn_alone_does_not_listen_to_a_network_without_keys(settings):
    """The settings refuse such a host, but `uvicorn --factory` never asked them."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("DLO_")}
    environment |= {"DLO_REDIS_URL": settings.redis_url, "DLO_DATA_DIR": str(settings.data_dir)}
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "uvicorn",
        "--factory",
        "services.app:create_app",
        "--host",
        "0.0.0.0",
    ]
    ended = subprocess.run(
        [*command, "--port", str(port)],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "without API keys" in ended.stdout + ended.stderr


def test_where_this_process_listens():
    with socket.create_server(("127.0.0.1", 0)):
        assert exposed() == []
    assert str(_address("0100007F")) == "127.0.0.1"
    assert str(_address("00000000")) == "0.0.0.0"
    assert _address("00000000000000000000000001000000").is_loopback
    assert str(_address("0000000000000000FFFF00000501A8C0")) == "192.168.1.5"


@pytest.mark.parametrize("path", ["/", "/viewer/app.js", "/v1/jobs", "/no/such", "/docs"])
def test_every_answer_tells_browsers_what_they_may_do(client, path):
    headers = client.get(path).headers
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert ("'unsafe-inline'" in headers["Content-Security-Policy"]) == (path == "/docs")


def test_a_body_that_stalls_is_given_up(client, problem, monkeypatch):
    """200 uploads that had stalled stayed open."""
    monkeypatch.setattr(gate, "_CHUNK_WITHIN_S", 0.05)

    async def never():
        await asyncio.sleep(60)

    with pytest.raises(gate.ProblemError) as error:
        asyncio.run(gate._Paced(never)())
    assert (error.value.problem.status, error.value.problem.code) == (408, "too_slow")


def test_a_body_that_drips_is_given_up(monkeypatch):
    monkeypatch.setattr(gate, "_GRACE_S", 0.0)
    monkeypatch.setattr(gate, "_SLOWEST_BYTES_S", 1e12)  # so that it depends on no processor

    async def drip():
        return {"type": "http.request", "body": b"x", "more_body": True}

    async def read():
        paced = gate._Paced(drip)
        for _ in range(100_000):
            await paced()

    with pytest.raises(gate.ProblemError, match="too slowly"):
        asyncio.run(read())


def test_after_the_body_there_is_no_hurry(monkeypatch):
    """Who waits for a job listens for its client's end, for as long as that takes."""
    monkeypatch.setattr(gate, "_CHUNK_WITHIN_S", 0.01)

    async def scenario():
        messages = iter([{"type": "http.request", "body": b""}])

        async def receive():
            if message := next(messages, None):
                return message
            await asyncio.sleep(0.1)
            return {"type": "http.disconnect"}

        paced = gate._Paced(receive)
        await paced()
        return await paced()

    assert asyncio.run(scenario())["type"] == "http.disconnect"


class TestConnections:
    @pytest.fixture
    def address(self, address, monkeypatch) -> tuple[str, int]:
        """Of the application behind the real protocol."""
        host, port = address.removeprefix("http://").split(":")
        return host, int(port)

    def test_one_that_says_nothing_is_closed(self, address, monkeypatch):
        monkeypatch.setattr(http_protocol, "HEADERS_WITHIN_S", 0.1)
        for first in (b"", b"GET / HTTP/1.1\r\nHost: x\r\nX: "):
            with socket.create_connection(address, timeout=20) as connection:
                connection.sendall(first)
                assert connection.recv(1) == b""

    def test_the_rest_of_a_body_that_is_answered_is_not_waited_for(self, address, monkeypatch):
        monkeypatch.setattr(http_protocol, "REST_WITHIN_S", 0.1)
        with socket.create_connection(address, timeout=20) as connection:
            connection.sendall(
                b"POST /v1/nothing HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000\r\n\r\nx"
            )
            answer = b""
            while chunk := connection.recv(4096):
                answer += chunk
            assert b"404" in answer

    def test_one_too_many_is_told_so(self, address, monkeypatch):
        """Out of descriptors the service answered 500, and filled its log."""
        monkeypatch.setattr(BoundedHttp, "most", 2)
        with contextlib.ExitStack() as open_:
            for _ in range(2):
                open_.enter_context(socket.create_connection(address))
            third = open_.enter_context(socket.create_connection(address, timeout=20))
            answer = third.recv(4096)
        assert answer.startswith(b"HTTP/1.1 503")
        assert b"too_many_connections" in answer
        assert b"Retry-After" in answer or b"retry-after" in answer
        wait_until(
            lambda: httpx.get(f"http://{address[0]}:{address[1]}/healthz").status_code == 200
        )

    def test_an_idle_one_is_there_for_longer_than_clients_use_it_again(self):
        """Client and service gave it up in the same moment, and a request was lost in between."""
        config = uvicorn.Config(FastAPI(), http=BoundedHttp, log_config=None)
        config.load()
        loop = asyncio.new_event_loop()
        protocol = BoundedHttp(config, uvicorn.Server(config).server_state, {}, loop)
        loop.close()
        assert (
            protocol.timeout_keep_alive
            == http_protocol.KEEP_ALIVE_S
            > 2 * httpx.Limits().keepalive_expiry
        )

    def test_there_are_never_more_than_descriptors_for_them(self, monkeypatch):
        monkeypatch.setattr(http_protocol.resource, "getrlimit", lambda _: (400, 400))
        assert connection_limit(2000) == 150
        assert connection_limit(7) == 7


def test_out_of_descriptors_it_asks_to_come_back(client, app, problem, monkeypatch):
    def fail(**_):
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(app.state.backend.queue, "recent", fail)
    refused = client.get("/v1/jobs")
    assert (refused.status_code, refused.json()["code"]) == (503, "overloaded")
    assert refused.headers["Retry-After"]
