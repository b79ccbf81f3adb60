"""The machine learning backend over HTTP, its brushes read by Label Studio's own SDK."""

from __future__ import annotations

import json

import httpx
import numpy as np
import pytest
from dlo_client import InstancesRequest
from dlo_client.errors import ConnectionFailed
from dlo_client.labelling.backend.answers import VERSION, Answers
from dlo_client.labelling.backend.pictures import TaskPictures
from dlo_client.labelling.backend.server import serving
from dlo_client.labelling.formats.exchange import Refused
from dlo_client.labelling.formats.label_studio import read
from dlo_client.labelling.formats.label_studio.writing import CONFIG

from tests.clients import samples

OWN_NAMES = """<View><Image name="photo" value="$picture"/>
<BrushLabels name="mask" toName="photo"><Label value="Cable"/></BrushLabels></View>"""


class Service:
    """Two cables in every picture but one."""

    def __init__(self) -> None:
        self.pictures: list[bytes] = []

    def run(self, request, image):
        self.pictures.append(image)
        if image == b"bad":
            raise ConnectionFailed("the service is away")
        return samples.two_cables()


@pytest.fixture
def backend(tmp_path):
    root = tmp_path / "storage"
    root.mkdir()
    (root / "a.png").write_bytes(b"picture a")
    (root / "bad.png").write_bytes(b"bad")
    (tmp_path / "secret").write_bytes(b"secret")
    answers = Answers(
        Service(), TaskPictures(root=root), InstancesRequest(files=[]), tmp_path / "corrections"
    )
    with serving(answers) as address, httpx.Client(base_url=address) as http:
        yield http


def task(name: str, field: str = "image") -> dict:
    return {"id": 1, "data": {field: f"/data/local-files/?d={name}"}}


def test_health_and_setup(backend):
    assert backend.get("/health").json()["status"] == "UP"
    assert backend.post("/setup", json={"project": "1", "schema": CONFIG}).json() == {
        "model_version": VERSION
    }


def test_a_prediction_is_read_by_label_studio(backend):
    from label_studio_sdk.converter import brush

    found = backend.post(
        "/predict", json={"tasks": [task("a.png")], "label_config": CONFIG}
    ).json()["results"][0]
    scene = samples.two_cables()
    assert found["score"] == min(instance.score for instance in scene.instances)
    kinds = [region["type"] for region in found["result"]]
    assert kinds.count("brushlabels") == kinds.count("vectorlabels") == len(scene.instances)
    assert kinds.count("keypointlabels") == len(scene.crossings)
    for region, instance in zip(
        (r for r in found["result"] if r["type"] == "brushlabels"), scene.instances, strict=True
    ):
        flat = np.asarray(brush.decode_rle(region["value"]["rle"]))
        mask = flat.reshape(samples.HEIGHT, samples.WIDTH, 4)[:, :, 3] > 127
        assert (mask == instance.mask_rle.array()).all()


def test_a_project_s_own_names_are_used(backend):
    body = {"tasks": [task("a.png", "picture")], "label_config": OWN_NAMES}
    regions = backend.post("/predict", json=body).json()["results"][0]["result"]
    assert {(r["from_name"], r["to_name"], *r["value"]["brushlabels"]) for r in regions} == {
        ("mask", "photo", "Cable")
    }


def test_a_task_without_a_picture_does_not_take_the_others_along(backend):
    tasks = [task("bad.png"), task("none.png"), task("../secret"), {"id": 2}, task("a.png")]
    results = backend.post("/predict", json={"tasks": tasks}).json()["results"]
    assert [bool(result["result"]) for result in results] == [False, False, False, False, True]
    assert "away" in results[0]["error"]
    assert "none.png" in results[1]["error"]
    assert "secret" in results[2]["error"]


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/setup", {"schema": "<View/>"}, 400),
        ("/setup", {"schema": "<View"}, 400),
        ("/predict", {"tasks": 1}, 400),
        ("/predict", [], 400),
        ("/train", {}, 404),
    ],
)
def test_what_cannot_be_answered_is_said(backend, path, body, status):
    assert backend.post(path, json=body).status_code == status


def test_finished_annotations_are_kept_as_corrections(backend, tmp_path):
    predicted = backend.post("/predict", json={"tasks": [task("a.png")]}).json()["results"][0][
        "result"
    ]
    annotation = {"id": 5, "result": predicted, "was_cancelled": False}
    event = {"action": "ANNOTATION_UPDATED", "task": task("a.png"), "annotation": annotation}
    assert backend.post("/webhook", json=event).json() == {"status": "kept"}
    assert backend.post("/webhook", json={"action": "PROJECT_UPDATED"}).json() == {
        "status": "ignored"
    }
    (file,) = (tmp_path / "corrections").iterdir()
    assert json.loads(file.read_text())[0]["annotations"] == [annotation]
    (label,) = read(file).labels
    assert len(label.instances) == len(samples.two_cables().instances)


def test_only_label_studio_is_asked_for_pictures():
    asked = []

    def label_studio(request: httpx.Request) -> httpx.Response:
        asked.append((str(request.url), request.headers.get("Authorization")))
        if request.url.path == "/api/token/refresh":
            return httpx.Response(200, json={"access": "short"})
        return httpx.Response(200, content=b"picture")

    transport = httpx.MockTransport(label_studio)
    pictures = TaskPictures("http://studio/", "legacy", transport=transport)
    assert pictures.read("/data/upload/1/a.png") == b"picture"
    assert pictures.read("http://studio/data/upload/1/a.png?x=1") == b"picture"
    for foreign in (
        "http://169.254.169.254/latest",
        "https://studio/a.png",
        "s3://bucket/a.png",
        "a.png",
    ):
        with pytest.raises(Refused):
            pictures.read(foreign)
    assert asked == [
        ("http://studio/data/upload/1/a.png", "Token legacy"),
        ("http://studio/data/upload/1/a.png?x=1", "Token legacy"),
    ]
    TaskPictures("http://studio", "a.b.c", transport=transport).read("/data/upload/1/a.png")
    assert asked[-1][1] == "Bearer short"
    with pytest.raises(Refused, match="--host"):
        TaskPictures().read("/data/upload/1/a.png")


def test_a_password_is_asked_for():
    answers = Answers(Service(), TaskPictures(), InstancesRequest())
    with serving(answers, password="open sesame") as address:
        assert httpx.get(f"{address}/health").status_code == 401
        assert httpx.get(f"{address}/health", auth=("any", "wrong")).status_code == 401
        assert httpx.get(f"{address}/health", auth=("any", "open sesame")).status_code == 200
