"""API keys of a file: scopes, owners, limits, rotation."""

import hashlib
import json

import pytest
from starlette.testclient import TestClient

from services import keys as keys_module
from services.app import create_app
from services.keys import KeyRing, add, read
from tests.services import samples

KEYS = {
    "reader": {"scopes": ["read"]},
    "cell": {"jobs": 2},
    "other": {},
    "chief": {"scopes": ["admin"]},
    "slow": {"requests_per_minute": 3},
    "busy": {"requests_at_once": 1},
    "small": {"stored_bytes": 12_000},
    "late": {"expires": "2020-01-01T00:00:00Z"},
}


def entry(name: str, key: str | None = None, **limits) -> str:
    lines = [f'name = "{name}"', f'sha256 = "{hashlib.sha256((key or name).encode()).hexdigest()}"']
    for field, value in limits.items():
        lines.append(f"{field} = {value if field == 'expires' else json.dumps(value)}")
    return "\n".join(["[[keys]]", *lines, ""])


def as_(name: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {name}"}


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setattr(keys_module, "_LOOK_EVERY_S", 0.0)
    file = tmp_path / "keys.toml"
    file.write_text("\n".join(entry(name, **limits) for name, limits in KEYS.items()))
    return file


@pytest.fixture
def guarded(service_settings, file):
    app = create_app(service_settings.model_copy(update={"api_keys_file": file}))
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def submit(guarded):
    def submit(name: str, expected: int = 202) -> str:
        response = guarded.post("/v1/jobs", json={"kind": "noop"}, headers=as_(name))
        assert response.status_code == expected, response.text
        return response.json().get("id", "")

    return submit


@pytest.mark.parametrize(
    ("name", "status"), [("reader", 200), ("chief", 200), ("late", 401), ("nobody", 401)]
)
def test_who_may_read(guarded, name, status):
    for path in ("/v1/jobs", "/v1/models", "/metrics"):
        assert guarded.get(path, headers=as_(name)).status_code == status


def test_a_scope_that_is_missing_is_named(guarded, submit):
    submit("reader", 403)
    refused = guarded.post("/v1/images", content=samples.encoded(), headers=as_("reader"))
    assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
    assert "`submit`" in refused.json()["detail"]


def test_a_key_sees_and_cancels_its_own_jobs_only(guarded, submit):
    """Every key saw, read and cancelled everybody's."""
    job_id = submit("cell")
    for path in ("", "/events", "/files/x"):
        for name in ("other", "reader"):
            assert (
                guarded.get(f"/v1/jobs/{job_id}{path}", headers=as_(name)).json()["code"]
                == "unknown_job"
            )
    assert guarded.delete(f"/v1/jobs/{job_id}", headers=as_("other")).status_code == 404
    assert guarded.get("/v1/jobs", headers=as_("other")).json()["jobs"] == []
    assert [job["id"] for job in guarded.get("/v1/jobs", headers=as_("cell")).json()["jobs"]] == [
        job_id
    ]
    assert guarded.get(f"/v1/jobs/{job_id}", headers=as_("cell")).json()["state"] == "queued"
    assert guarded.delete(f"/v1/jobs/{job_id}", headers=as_("cell")).json()["state"] == "cancelled"


def test_an_admin_sees_and_cancels_everybodys(guarded, submit):
    job_id = submit("cell")
    assert [job["id"] for job in guarded.get("/v1/jobs", headers=as_("chief")).json()["jobs"]] == [
        job_id
    ]
    assert guarded.delete(f"/v1/jobs/{job_id}", headers=as_("chief")).json()["state"] == "cancelled"


def test_a_key_may_have_so_many_jobs_under_way(guarded, submit):
    first, _ = submit("cell"), submit("cell")
    submit("cell", 429)
    submit("other")
    guarded.delete(f"/v1/jobs/{first}", headers=as_("cell"))
    submit("cell")


def test_a_key_may_send_so_many_requests_a_minute(guarded):
    answers = [guarded.get("/v1/jobs", headers=as_("slow")) for _ in range(5)]
    assert [answer.status_code for answer in answers] == [200, 200, 200, 429, 429]
    assert 1 <= int(answers[-1].headers["Retry-After"]) <= 60
    assert guarded.get("/v1/jobs", headers=as_("cell")).status_code == 200


def test_a_key_may_have_so_many_requests_under_way(guarded):
    under_way = guarded.app.state.backend.under_way
    assert guarded.get("/v1/jobs", headers=as_("busy")).status_code == 200
    assert under_way["busy"] == 0
    under_way["busy"] = 1
    assert guarded.get("/v1/jobs", headers=as_("busy")).json()["code"] == "too_many_requests"


def test_a_key_may_keep_so_many_bytes(guarded, service_settings):
    pictures = [samples.encoded(samples.pixels(width, 40)) for width in (40, 41, 42, 43)]
    for picture in (pictures[0], pictures[0], pictures[1]):
        assert guarded.post("/v1/images", content=picture, headers=as_("small")).status_code == 201
    kept = len(list(service_settings.blobs_dir.rglob("*")))
    refused = [
        guarded.post("/v1/images", content=picture, headers=as_("small"))
        for picture in pictures[2:]
    ]
    assert (refused[-1].status_code, refused[-1].json()["code"]) == (507, "quota_exceeded")
    files = [("image", ("x", pictures[3])), ("request", (None, '{"kind": "segment"}'))]
    assert guarded.post("/v1/jobs", files=files, headers=as_("small")).status_code == 507
    assert guarded.get("/v1/jobs", headers=as_("small")).json()["jobs"] == []
    assert guarded.post("/v1/images", content=pictures[3], headers=as_("other")).status_code == 201
    assert kept >= 2


def test_keys_change_without_a_restart(guarded, file, submit):
    """Rotation: the new key of the same name sees the jobs of the old one, which then closes."""
    job_id = submit("cell")
    file.write_text(file.read_text() + entry("cell", "cell-2027"))
    assert guarded.get(f"/v1/jobs/{job_id}", headers=as_("cell-2027")).status_code == 200
    file.write_text(entry("cell", "cell-2027"))
    assert guarded.get(f"/v1/jobs/{job_id}", headers=as_("cell")).status_code == 401
    assert guarded.get(f"/v1/jobs/{job_id}", headers=as_("cell-2027")).status_code == 200


@pytest.mark.parametrize(
    "broken", ["", "[[keys]", entry("x", scopes=["write"]), '[[keys]]\nname = "x"\n']
)
def test_a_file_that_breaks_meanwhile_changes_nothing(guarded, file, broken):
    file.write_text(broken)
    assert guarded.get("/v1/jobs", headers=as_("cell")).status_code == 200
    with pytest.raises(ValueError, match=r"keys\.toml"):
        read(file)


def test_a_file_that_is_gone_meanwhile_changes_nothing(guarded, file):
    file.unlink()
    assert guarded.get("/v1/jobs", headers=as_("cell")).status_code == 200


def test_the_service_does_not_start_with_a_file_that_cannot_be_used(service_settings, tmp_path):
    with pytest.raises(OSError, match="missing"):
        create_app(service_settings.model_copy(update={"api_keys_file": tmp_path / "missing.toml"}))


def test_making_a_key(tmp_path):
    file = tmp_path / "keys.toml"
    first, second = add(file, "cell", ("read",)), add(file, "night", ("read", "submit"))
    assert oct(file.stat().st_mode)[-3:] == "600"
    assert first not in file.read_text()
    ring = KeyRing((), file)
    assert (ring.find(first).name, ring.find(first).scopes) == ("cell", ("read",))
    assert ring.find(second).allows("submit")
    assert ring.find("another") is None
