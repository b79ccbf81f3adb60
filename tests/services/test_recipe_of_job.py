"""``GET /v1/jobs/{id}/recipe``: a finished job becomes a recipe that repeats it."""

from __future__ import annotations

import json

import pytest
from dlo_client.contracts import NoopResult

from services.examples import CAMERA, EXAMPLES, PICTURES
from tests.services.samples import encoded
from workers.steps import LONGEST_KEPT_REQUEST

OUTPUT = {"unit": "mm", "rotation": "kuka_abc"}


@pytest.fixture
def ended(client, ledger):
    """Submit a request and end its job as a worker would; gives the job's address."""

    def ended(request: dict, **form) -> str:
        files = [("request", json.dumps(request).encode()), *(form.get("parts") or [])]
        reply = (
            client.post("/v1/jobs", files=files) if form else client.post("/v1/jobs", json=request)
        )
        assert reply.status_code == 202, reply.text
        job_id = reply.json()["id"]
        ledger.succeed(ledger.claim(job_id, "w"), NoopResult(held_s=0.0), [], {})
        return f"/v1/jobs/{job_id}"

    return ended


def test_what_was_asked_for_without_what_was_of_that_job(client, ended):
    request = {
        "kind": "instances",
        "threshold": 0.4,
        "files": [],
        "label": "shelf 3",
        "priority": "batch",
        "params": {"neighbors": 4},
        "method": "rt_dlo",
    }
    body = client.get(f"{ended(request, parts=[('image', encoded())])}/recipe").json()
    picture = client.post("/v1/images", content=encoded()).json()["id"]
    assert body["name"] == "shelf 3"
    assert body["samples"] == [{"image": {"id": picture}, "flange": None}]
    kept = {
        name: request[name]
        for name in ("kind", "threshold", "files", "priority", "method", "params")
    }
    assert body["request"] == kept
    assert client.put("/v1/recipes/7", json=body).status_code == 201
    (job,) = client.post("/v1/recipes/7/dry-run").json()
    assert client.get(f"/v1/jobs/{job['id']}/recipe").json()["request"] == kept


def test_views_keep_their_cameras_and_lose_their_pictures(client, ended):
    request = {"kind": "reconstruct", **EXAMPLES["reconstruct"]}
    body = client.get(f"{ended(request)}/recipe").json()
    assert [set(view) for view in body["request"]["views"]] == [
        {"intrinsics", "T_world_camera"}
    ] * 3
    assert [sample["image"]["id"] for sample in body["samples"]] == list(PICTURES)
    assert client.put("/v1/recipes/9", json=body).status_code == 201
    (job,) = client.post("/v1/recipes/9/dry-run").json()
    assert job["recipe"] == {"number": 9, "version": 1}


def test_the_output_gets_the_stored_camera_with_its_calibration(client, ended):
    client.put("/v1/cameras/over", json=CAMERA | {"sigma_m": 0.001})
    output = OUTPUT | {"camera": CAMERA}
    body = client.get(
        f"{ended({'kind': 'instances', **EXAMPLES['instances'], 'output': output})}/recipe"
    ).json()
    assert body["camera"] == "over"
    assert body["output"]["rotation"] == "kuka_abc"
    assert client.put("/v1/recipes/7", json=body).status_code == 201
    moved = OUTPUT | {"camera": CAMERA, "plane": {"offset_m": 0.01}}
    other = client.get(
        f"{ended({'kind': 'instances', **EXAMPLES['instances'], 'output': moved})}/recipe"
    ).json()
    assert other["camera"] is None, "no stored camera has this plane"


def test_without_its_mask_it_would_be_another_request(client, ended):
    parts = [("image", encoded()), ("mask", encoded())]
    assert client.get(f"{ended({'kind': 'instances'}, parts=parts)}/recipe").json()["samples"] == []


def test_of_a_job_that_a_recipe_made_it_is_that_recipe(client, ledger):
    client.put("/v1/recipes/7", json={"name": "first", "request": {"kind": "instances"}})
    job = client.post("/v1/recipes/7/run", files={"image": encoded()}).json()
    client.put("/v1/recipes/7", json={"name": "second", "request": {"kind": "segment"}})
    assert client.get(f"/v1/jobs/{job['id']}/recipe").json()["name"] == "first"


def test_jobs_of_which_there_is_none(client, ended, problem):
    problem(client.get(f"{ended({'kind': 'noop'})}/recipe"), 409, "no_pictures")
    area = [[float(x), float(x % 2)] for x in range(LONGEST_KEPT_REQUEST // 200)]
    request = {"kind": "instances", **EXAMPLES["instances"], "regions": {"never": [area] * 50}}
    problem(client.get(f"{ended(request)}/recipe"), 409, "request_not_kept")
    problem(client.get(f"/v1/jobs/{'0' * 32}/recipe"), 404)
