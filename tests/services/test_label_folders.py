"""Label folders: read, and saved so that nobody overwrites another's work or files it under another
picture."""

from __future__ import annotations

import hashlib
import io
import json
import re
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling.formats import READERS, Wanted
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.store import Entry, LabelStore, corrected_file, draft_file, read_label
from PIL import Image
from starlette.testclient import TestClient

from services.app import create_app
from tests.clients.labelling import drawn
from tests.processes import ROOT

NAME, TWIN = "shelf 2/a.png", "b.png"
FOLDER = "monday"


def png(gray: int) -> bytes:
    data = io.BytesIO()
    Image.new("L", (drawn.WIDTH, drawn.HEIGHT), gray).save(data, "PNG")
    return data.getvalue()


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


@pytest.fixture
def root(tmp_path) -> Path:
    """Two pictures and their labels, as `dlo label` leaves them."""
    for name, gray in ((NAME, 10), (TWIN, 20)):
        file = tmp_path / "pictures" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(png(gray))
    with LabelStore(tmp_path / "labels" / FOLDER, write=True) as store:
        store.remember_source(str(tmp_path / "pictures"))
        for name, gray in ((NAME, 10), (TWIN, 20)):
            label = drawn.label(name).model_copy(update={"sha256": sha256(png(gray))})
            store.put(Entry(name, "done", sha256=sha256(png(gray)), certainty=0.6), label)
        store.put(Entry("broken.png", "failed", detail="no picture"))
    (tmp_path / "labels" / "something else").mkdir()
    return tmp_path / "labels"


@pytest.fixture
def client(service_settings, root):
    app = create_app(service_settings.model_copy(update={"labels_dir": root}))
    with TestClient(app, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def save(client):
    """``save(label, etag)``: the answer to saving it for the first picture."""

    def put(label: PictureLabel, etag: str | None, name: str = NAME):
        headers = {"If-Match": etag} if etag else {}
        return client.put(
            _path("label"), params={"name": name}, content=label.model_dump_json(), headers=headers
        )

    return put


def _path(part: str) -> str:
    return f"/v1/label-folders/{FOLDER}/{part}"


def get(client, part: str = "label", name: str = NAME):
    return client.get(_path(part), params={"name": name})


def test_folders_and_their_pictures_are_listed(client):
    assert client.get("/v1/label-folders").json() == {"folders": [FOLDER]}
    pictures = client.get(f"/v1/label-folders/{FOLDER}").json()["pictures"]
    assert [(p["name"], p["state"]) for p in pictures] == [(TWIN, "new"), (NAME, "new")]
    assert pictures[1]["sha256"] == sha256(png(10))


def test_without_a_setting_there_are_none(service_settings):
    with TestClient(create_app(service_settings)) as client:
        assert client.get("/v1/label-folders").json() == {"folders": []}
        assert client.get(f"/v1/label-folders/{FOLDER}").status_code == 404


@pytest.mark.parametrize("folder", ["other", "..", "something else", "."])
def test_an_unknown_folder_is_a_problem(client, folder):
    assert client.get(f"/v1/label-folders/{folder}/label", params={"name": NAME}).status_code == 404


@pytest.mark.parametrize("name", ["c.png", "../ledger.sqlite", "broken.png", "/etc/passwd"])
@pytest.mark.parametrize("part", ["label", "picture"])
def test_only_labelled_pictures_are_there(client, problem, part, name):
    problem(get(client, part, name), 404, "unknown_image")


def test_a_change_is_a_draft_until_somebody_confirms_it(client, save, root):
    label = PictureLabel.model_validate_json(get(client).content)
    changed = label.model_copy(
        update={
            "instances": label.instances[:1],
            "crossings": [],
            "ignore": [[(0, 0), (9, 0), (9, 9)]],
        }
    )
    first = save(changed, get(client).headers["etag"])
    assert first.status_code == 204
    assert client.get(f"/v1/label-folders/{FOLDER}").json()["pictures"][1]["state"] == "changed"
    assert not corrected_file(root / FOLDER, NAME).exists(), "nobody has confirmed it"
    assert PictureLabel.model_validate_json(get(client).content) == changed
    second = save(changed.model_copy(update={"origin": "corrected"}), first.headers["etag"])
    assert second.status_code == 204
    assert client.get(f"/v1/label-folders/{FOLDER}").json()["pictures"][1]["state"] == "confirmed"
    assert read_label(corrected_file(root / FOLDER, NAME)).ignore == changed.ignore
    assert not draft_file(root / FOLDER, NAME).exists()
    assert get(client).headers["etag"] == second.headers["etag"]


def test_two_people_do_not_overwrite_each_other(client, save, problem):
    etag = get(client).headers["etag"]
    mine, theirs = (
        drawn.label().model_copy(update={"instances": drawn.label().instances[:k]}) for k in (1, 2)
    )
    assert save(theirs, etag).status_code == 204
    problem(save(mine, etag), 412, "changed_meanwhile")
    assert len(PictureLabel.model_validate_json(get(client).content).instances) == 2
    assert save(mine, get(client).headers["etag"]).status_code == 204


def test_saving_needs_to_say_what_it_replaces(save, problem):
    problem(save(drawn.label(), None), 428, "etag_required")


def test_a_label_never_lands_under_another_picture(client, save, problem):
    etag = get(client).headers["etag"]
    other = drawn.label().model_copy(update={"sha256": sha256(png(20))})
    problem(save(other, etag), 409, "other_image")
    problem(save(drawn.label().model_copy(update={"width": 91}), etag), 422, field="width")
    assert get(client).headers["etag"] == etag


def test_what_is_no_label_is_refused_with_its_field(client, problem):
    headers = {"If-Match": get(client).headers["etag"]}
    bad = client.put(
        _path("label"), params={"name": NAME}, content=b'{"width": -1}', headers=headers
    )
    assert "width" in {error["field"] for error in problem(bad, 422)["errors"]}


def test_the_picture_is_the_one_that_was_labelled(client, problem, root):
    answer = get(client, "picture")
    assert (answer.content, answer.headers["content-type"]) == (png(10), "image/png")
    (root.parent / "pictures" / NAME).write_bytes(png(11))
    problem(get(client, "picture"), 409, "other_image")
    (root.parent / "pictures" / TWIN).unlink()
    problem(get(client, "picture", TWIN), 404, "unknown_image")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coco-polygons", "cvat", "png"])
def test_labels_leave_in_the_format_of_another_tool(client, name, tmp_path):
    label = drawn.label(NAME).model_copy(update={"origin": "corrected", "sha256": sha256(png(10))})
    answer = client.post(
        "/v1/label-exports", params={"format": name}, content=label.model_dump_json()
    )
    assert answer.status_code == 200, answer.text
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        archive.extractall(tmp_path / "out")
    reader = READERS.get(name.partition("-polygons")[0])
    if reader is None:
        ids = np.asarray(Image.open(next((tmp_path / "out").rglob("*.png"))))
        assert set(np.unique(ids)) == {0, 1, 2, 3}
        return
    (file,) = (
        file
        for file in (tmp_path / "out").rglob("*.*")
        if file.suffix in (".json", ".jsonl", ".xml")
    )
    (back,) = reader(file, Wanted(sizes={NAME: (drawn.WIDTH, drawn.HEIGHT)})).labels
    assert len(back.instances) == 3


@pytest.mark.slow
def test_yolo_says_where_the_pictures_belong(client):
    lines = "\n".join(drawn.label(name).model_dump_json() for name in ("a/1.png", "b/1.jfif"))
    answer = client.post("/v1/label-exports?format=yolo", content=lines)
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        places = json.loads(archive.read("yolo/images.json"))
        labels = {name for name in archive.namelist() if name.endswith(".txt")}
    assert set(places) == {"a/1.png", "b/1.jfif"}
    assert {place.rpartition("/")[2] for place in places.values()} == {"a__1.png", "b__1.jpg"}
    assert {
        f"yolo/{place.replace('images', 'labels').rpartition('.')[0]}.txt"
        for place in places.values()
    } == labels


def test_what_an_export_needs_is_installed_with_the_service():
    """Every export of the bench but our own answered 501 in the image."""
    extra = tomllib.loads((ROOT / "clients/python/pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    pinned = re.findall(
        r"^([\w.-]+)==", (ROOT / "requirements/service.txt").read_text(), re.MULTILINE
    )
    assert {re.split(r"[<>=~]", one)[0] for one in extra["label"]} <= set(pinned)


def test_labels_that_are_none_are_refused(client, problem):
    problem(
        client.post("/v1/label-exports?format=cvat", content=b'{"width": 1}'), 422, field="labels"
    )
    problem(client.post("/v1/label-exports?format=xml", content=b""), 422, field="format")
