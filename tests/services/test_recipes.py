"""``/v1/recipes`` and ``/v1/cameras``: stored, versioned, run with pictures alone."""

from __future__ import annotations

import json

import pytest
from starlette.testclient import TestClient

from services import keys
from services.app import create_app
from services.examples import CAMERA, PICTURES, RECIPE
from tests.services.samples import encoded, sixteen_bit_png

INSTANCES = {"name": "cables", "request": {"kind": "instances", "files": []}}
LENS = {"width": 40, "height": 30, "fx": 40, "fy": 40, "cx": 20, "cy": 15}
ON_ARM = {
    "intrinsics": LENS,
    "T_flange_camera": [[1, 0, 0, 0], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]],
}
SCAN = {
    "name": "scan",
    "request": {"kind": "reconstruct"},
    "camera": "wrist",
    "output": {"unit": "mm", "rotation": "kuka_abc"},
}


def entry(job_queue, job) -> dict:
    """The request that a worker would see."""
    return json.loads(job_queue._client.hget(f"dlo:job:{job['id']}", "request"))


@pytest.fixture
def store(client):
    def store(number: int, body: dict = INSTANCES) -> dict:
        reply = client.put(f"/v1/recipes/{number}", json=body)
        assert reply.status_code in (200, 201), reply.text
        return reply.json()

    return store


class TestStore:
    def test_versions_count_up(self, client, store):
        assert [store(7)["version"] for _ in range(2)] == [1, 2]
        assert client.put("/v1/recipes/8", json=INSTANCES).status_code == 201
        assert [(r["number"], r["version"]) for r in client.get("/v1/recipes").json()] == [
            (7, 2),
            (8, 1),
        ]
        assert [r["version"] for r in client.get("/v1/recipes/7/versions").json()] == [2, 1]
        assert client.get("/v1/recipes/7?version=1").json()["request"] == INSTANCES["request"]

    def test_another_replica_sees_it(self, store, service_settings):
        store(7)
        with TestClient(create_app(service_settings)) as other:
            assert other.get("/v1/recipes/7").json()["name"] == "cables"

    def test_deleted(self, client, store, problem):
        store(7)
        assert client.delete("/v1/recipes/7").status_code == 204
        problem(client.get("/v1/recipes/7"), 404, "unknown_recipe")
        problem(client.delete("/v1/recipes/7"), 404)
        problem(client.post("/v1/recipes/7/run"), 404)

    @pytest.mark.parametrize(
        ("change", "field"),
        [
            ({"request": {"kind": "nothing"}}, "request.kind"),
            ({"request": {"kind": "instances", "threshold": 2}}, "request.threshold"),
            ({"request": {"kind": "instances", "output": {}}}, "request"),
            ({"request": {"kind": "instances"}, "output": {}}, "output"),
            ({"request": {"kind": "segment"}, "output": {}}, "output"),
            ({"request": {"kind": "reconstruct"}}, "request.views.0.intrinsics"),
            ({"camera": "nobody"}, "camera"),
            ({"samples": [{"image": {"id": "0" * 64}}]}, "samples.0.image"),
            ({"name": ""}, "name"),
            ({"more": 1}, "more"),
        ],
    )
    def test_what_could_not_run_is_not_stored(self, client, problem, change, field):
        problem(client.put("/v1/recipes/7", json=INSTANCES | change), 422, field=field)
        assert client.get("/v1/recipes").json() == []

    def test_pictures_that_the_request_names_stay(self, client, job_queue, problem):
        """A picture inside the request would have been gone a day later, and the recipe with it."""
        picture = client.post("/v1/images", content=encoded()).json()["id"]
        body = {"name": "fixed", "request": {"kind": "instances", "image": {"id": picture}}}
        assert client.put("/v1/recipes/7", json=body).status_code == 201
        assert job_queue.recipes.pictures() == {picture}
        body["request"]["image"]["id"] = "0" * 64
        problem(client.put("/v1/recipes/7", json=body), 422, "unknown_image", field="request")

    def test_no_json(self, client, problem):
        problem(
            client.put("/v1/recipes/7", content=b"{", headers={"content-type": "application/json"}),
            422,
        )
        problem(client.put("/v1/recipes/7", content=b"{}"), 415)
        problem(client.put("/v1/recipes/65536", json=INSTANCES), 422)


class TestRun:
    def test_with_a_picture_in_every_form(self, client, store, job_queue):
        store(7)
        picture = encoded()
        known = client.post("/v1/images", content=picture).json()["id"]
        forms = [
            {"files": {"image": picture}},
            {"content": picture, "headers": {"content-type": "image/png"}},
            {"json": {"images": [{"id": known}]}},
            {"files": {"image": picture, "mask": picture}},
        ]
        for form in forms:
            reply = client.post("/v1/recipes/7/run", **form)
            assert reply.status_code == 202, reply.text
            job = reply.json()
            assert job["recipe"] == {"number": 7, "version": 1}
            assert entry(job_queue, job)["image"] == {"id": known}
            assert reply.headers["location"] == f"/v1/jobs/{job['id']}"
            assert client.get(f"/v1/jobs/{job['id']}").json()["recipe"] == job["recipe"]

    def test_an_older_version(self, client, store, job_queue):
        store(7, {"name": "a", "request": {"kind": "noop", "hold_s": 1}})
        store(7, {"name": "b", "request": {"kind": "noop", "hold_s": 2}})
        old, new = (client.post(f"/v1/recipes/7/run{which}").json() for which in ("?version=1", ""))
        assert (entry(job_queue, old)["hold_s"], entry(job_queue, new)["hold_s"]) == (1, 2)
        assert old["recipe"]["version"] == 1

    def test_the_same_key_gives_the_same_job(self, client, store, problem):
        store(7)
        run = {"files": {"image": encoded()}, "headers": {"Idempotency-Key": "part 12"}}
        first, again = (client.post("/v1/recipes/7/run", **run).json()["id"] for _ in range(2))
        assert first == again
        store(7, {"name": "changed", "request": {"kind": "instances", "threshold": 0.4}})
        problem(client.post("/v1/recipes/7/run", **run), 409, "idempotency_conflict")

    @pytest.mark.parametrize(
        ("form", "field"),
        [
            ({}, "image"),
            ({"files": [("image", encoded()), ("image", encoded())]}, "image"),
            ({"json": {"images": [{"id": "0" * 64}]}}, "images.0"),
            ({"files": {"image": b"none"}}, "image"),
            ({"files": {"request": b"{}"}}, "request"),
            ({"files": {"image": encoded(), "flange": b"[[0,0,0,0,0,0,1]]"}}, "flange"),
            ({"files": {"image": encoded(), "flange": b"[[0,0]]"}}, "flange.0"),
            ({"files": {"image": encoded(), "flange": b"["}}, "flange"),
        ],
    )
    def test_wrong_pictures_are_named(self, client, store, problem, form, field):
        store(7)
        problem(client.post("/v1/recipes/7/run", **form), 422, field=field)

    def test_views_get_the_camera_on_the_arm(self, client, store, job_queue, problem):
        assert client.put("/v1/cameras/wrist", json=ON_ARM).status_code == 201
        store(9, SCAN)
        flange = [[0, 0, 500, 0, 0, 180], [100, 0, 500, 90, 0, 180]]
        files = [("image", encoded()), ("image", encoded(format_name="JPEG"))]
        reply = client.post(
            "/v1/recipes/9/run", files=[*files, ("flange", json.dumps(flange).encode())]
        )
        assert reply.status_code == 202, reply.text
        request = entry(job_queue, reply.json())
        first, second = (view["T_world_camera"] for view in request["views"])
        assert [row[3] for row in first[:3]] == pytest.approx([0, -0.1, 0.5]), (
            "0.1 m along the flange's y, turned down"
        )
        assert [row[3] for row in second[:3]] == pytest.approx([0.1 + 0.1, 0, 0.5])
        assert request["views"][0]["intrinsics"]["fx"] == 40
        assert request["output"]["rotation"] == "kuka_abc"
        problem(client.post("/v1/recipes/9/run", files=files), 422, field="flange")
        short = [*files, ("flange", json.dumps([[0, 0, 0, 1], flange[1]]).encode())]
        problem(client.post("/v1/recipes/9/run", files=short), 422, field="flange.0")

    def test_the_output_gets_camera_plane_and_tool(self, client, store, job_queue):
        standing = {
            "intrinsics": LENS,
            "T_world_camera": ON_ARM["T_flange_camera"],
            "plane": {"offset_m": 0.02},
        }
        client.put("/v1/cameras/over", json=standing | {"T_flange_tool": ON_ARM["T_flange_camera"]})
        store(7, INSTANCES | {"camera": "over", "output": {"frame": "camera", "unit": "mm"}})
        output = entry(
            job_queue, client.post("/v1/recipes/7/run", files={"image": encoded()}).json()
        )["output"]
        assert output["plane"]["offset_m"] == 0.02
        assert output["camera"]["T_world_camera"][1][3] == 0.1
        assert output["T_flange_tool"][1][3] == 0.1

    def test_depth_gets_the_camera(self, client, store, job_queue):
        """Depth is measured with the camera that the recipe names; a run brings pictures alone."""
        client.put(
            "/v1/cameras/over",
            json={"intrinsics": LENS, "T_world_camera": ON_ARM["T_flange_camera"]},
        )
        store(7, INSTANCES | {"camera": "over"})
        parts = {"image": encoded(), "depth": sixteen_bit_png()}
        reply = client.post("/v1/recipes/7/run", files=parts)
        assert reply.status_code == 202, reply.text
        request = entry(job_queue, reply.json())
        assert set(request["depth"]) == {"id"}
        assert request["intrinsics"]["fx"] == 40
        assert request["T_world_camera"][1][3] == 0.1
        known = {"images": [request["image"]], "depth": request["depth"]}
        assert client.post("/v1/recipes/7/run", json=known).status_code == 202


class TestDryRun:
    def test_one_job_a_picture(self, client, store, job_queue):
        pictures = [
            client.post("/v1/images", content=encoded(format_name=f)).json()["id"]
            for f in ("PNG", "JPEG")
        ]
        store(7, INSTANCES | {"samples": [{"image": {"id": picture}} for picture in pictures]})
        jobs = client.post("/v1/recipes/7/dry-run").json()
        assert [entry(job_queue, job)["image"]["id"] for job in jobs] == pictures
        assert {job["recipe"]["number"] for job in jobs} == {7}

    def test_one_job_for_views(self, client, store, job_queue):
        on_arm = {"intrinsics": CAMERA["intrinsics"], "T_flange_camera": ON_ARM["T_flange_camera"]}
        client.put("/v1/cameras/wrist", json=on_arm)
        samples = [
            {"image": {"id": picture}, "flange": [30 * k, 0, 300, 0, 0, 180]}
            for k, picture in enumerate(PICTURES)
        ]
        store(9, SCAN | {"samples": samples})
        (job,) = client.post("/v1/recipes/9/dry-run").json()
        assert [view["image"]["id"] for view in entry(job_queue, job)["views"]] == list(PICTURES)

    def test_the_example_of_the_documentation(self, client, store):
        store(1, RECIPE)
        assert len(client.post("/v1/recipes/1/dry-run").json()) == 1

    def test_without_samples(self, client, store, problem):
        store(7)
        problem(client.post("/v1/recipes/7/dry-run"), 409, "no_samples")


class TestCameras:
    def test_versions(self, client, problem):
        assert client.put("/v1/cameras/wrist", json=ON_ARM).json()["version"] == 1
        assert client.put("/v1/cameras/wrist", json=CAMERA).json()["version"] == 2
        first = client.get("/v1/cameras/wrist?version=1").json()["camera"]
        assert first["T_flange_camera"] == ON_ARM["T_flange_camera"]
        assert [camera["name"] for camera in client.get("/v1/cameras").json()] == ["wrist"]
        assert client.delete("/v1/cameras/wrist").status_code == 204
        problem(client.get("/v1/cameras/wrist"), 404, "unknown_camera")

    def test_a_file_keeps_the_poses(self, client):
        client.put("/v1/cameras/wrist", json=ON_ARM)
        text = "image_width: 640\nimage_height: 480\ncamera_matrix: {data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
        reply = client.put(
            "/v1/cameras/wrist", content=text, headers={"content-type": "application/yaml"}
        )
        assert reply.status_code == 200, reply.text
        camera = client.get("/v1/cameras/wrist").json()["camera"]
        assert camera["intrinsics"]["fx"] == 500
        assert camera["T_flange_camera"] == ON_ARM["T_flange_camera"]

    @pytest.mark.parametrize(
        ("body", "field"),
        [
            ({}, "intrinsics"),
            (ON_ARM | CAMERA, "T_flange_camera"),
            (
                ON_ARM
                | {"T_flange_camera": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
                "T_flange_camera",
            ),
        ],
    )
    def test_wrong_ones_are_refused(self, client, problem, body, field):
        problem(client.put("/v1/cameras/wrist", json=body), 422, field=field)

    def test_a_name_has_a_form(self, client, problem):
        problem(client.put("/v1/cameras/Wrist%20", json=ON_ARM), 422)


def test_scopes(service_settings, tmp_path):
    """Who stores a recipe is not who runs it."""
    file = tmp_path / "keys.toml"
    writer, runner, reader = (
        {"Authorization": f"Bearer {keys.add(file, name, (scope,))}"}
        for name, scope in (("engineer", "admin"), ("plc", "submit"), ("panel", "read"))
    )
    settings = service_settings.model_copy(update={"api_keys_file": file})
    with TestClient(create_app(settings)) as client:

        def put(headers):
            return client.put("/v1/recipes/7", json=INSTANCES, headers=headers)

        def run(headers):
            return client.post("/v1/recipes/7/run", files={"image": encoded()}, headers=headers)

        assert [put(headers).status_code for headers in ({}, reader, runner, writer)] == [
            401,
            403,
            403,
            201,
        ]
        assert client.get("/v1/recipes/7", headers=reader).json()["author"] == "engineer"
        assert [run(headers).status_code for headers in (reader, runner)] == [403, 202]
        assert client.delete("/v1/recipes/7", headers=runner).status_code == 403
        assert client.put("/v1/cameras/x", json=ON_ARM, headers=runner).status_code == 403
