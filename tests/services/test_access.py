"""API keys: who may call, and when the service refuses to start without them."""

import hashlib

import pytest
from pydantic import ValidationError
from starlette.testclient import TestClient

from services.app import create_app
from services.settings import ServiceSettings, is_loopback

KEY, OTHER = "correct horse", "battery staple"
HASHES = tuple(hashlib.sha256(key.encode()).hexdigest() for key in (KEY, OTHER))
GUARDED = ["/v1/jobs", "/v1/models", "/v1/jobs/" + "0" * 32, "/metrics"]


@pytest.fixture
def guarded(service_settings):
    app = create_app(service_settings.model_copy(update={"api_key_hashes": HASHES}))
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


def test_without_keys_everyone_on_this_machine_may_call(client):
    assert client.get("/v1/jobs").status_code == 200


@pytest.mark.parametrize("path", GUARDED)
@pytest.mark.parametrize(
    "header", [None, "Bearer wrong", "Bearer ", f"Basic {KEY}", KEY, f"Bearer {HASHES[0]}"]
)
def test_no_entry_without_a_key(guarded, path, header):
    response = guarded.get(path, headers={"Authorization": header} if header else {})
    assert response.status_code == 401
    assert response.headers["content-type"] == "application/problem+json"
    assert response.headers["www-authenticate"] == "Bearer"
    assert response.json()["code"] == "unauthorized"


def test_no_body_is_read_without_a_key(guarded):
    response = guarded.post("/v1/images", content=bytes(40 * 1024 * 1024))
    assert response.status_code == 401


@pytest.mark.parametrize("key", [KEY, OTHER])
def test_each_key_opens(guarded, key):
    assert guarded.get("/v1/jobs", headers={"Authorization": f"Bearer {key}"}).status_code == 200


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/healthz", "/docs", "/openapi.json"])
def test_probes_and_docs_need_no_key(guarded, path):
    assert guarded.get(path).status_code == 200


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "robot.cell", ""])
def test_refuses_to_listen_to_a_network_without_keys(host):
    with pytest.raises(ValidationError, match="DLO_API_KEY_HASHES"):
        ServiceSettings(host=host)
    assert ServiceSettings(host=host, api_key_hashes=HASHES).host == host


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.53", "::1", "localhost"])
def test_loopback_needs_no_keys(host):
    assert is_loopback(host)
    assert ServiceSettings(host=host).api_key_hashes == ()


def test_hashes_come_from_the_environment(monkeypatch):
    monkeypatch.setenv("DLO_API_KEY_HASHES", f"{HASHES[0]}, {HASHES[1]}")
    assert ServiceSettings().api_key_hashes == HASHES


def test_a_key_in_place_of_its_hash_is_refused(monkeypatch):
    monkeypatch.setenv("DLO_API_KEY_HASHES", KEY)
    with pytest.raises(ValidationError, match="SHA-256"):
        ServiceSettings()
