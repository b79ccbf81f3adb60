"""``adapt``: labels in, a network of the owner's out; refused when it is worse; goes on where it
was cut off."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import zipfile

import cv2
import numpy as np
import pytest
from dlo_client.contracts import AdaptRequest, UploadRef

from models.weights.inference import Runtime, manifest
from tests.workers.networks import tiny
from workers import stages
from workers.blobs import FolderBlobs
from workers.networks.store import NetworkStore
from workers.stages import adapt
from workers.stages.outcome import InvalidInput, Tools

SMALL = ("--height", "64", "--width", "96", "--batch", "2", "--renders", "2", "--general", "1")
REPORT = {
    "before": 70.0,
    "after": 80.0,
    "general_before": 85.0,
    "general_after": 84.9,
    "share": 0.5,
    "refused": None,
    "pictures": 4,
    "kept_aside": [{"name": "a", "before": 70.0, "after": 80.0}],
    "steps": 9,
    "seconds": 6.0,
}


@pytest.fixture
def tools(settings) -> Tools:
    return Tools(
        FolderBlobs(settings.blobs_dir, settings.blob_ttl_s),
        10**7,
        Runtime(threads=1),
        store=NetworkStore.of(settings),
        owner="a",
        training_dir=settings.training_dir,
        training_options=SMALL,
    )


def png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def archive(count: int = 5, **other: bytes) -> bytes:
    """Bright bars on dark ground, 160 × 96."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for k in range(count):
            image, ids = np.full((96, 160, 3), 40 + k, np.uint8), np.zeros((96, 160), np.uint8)
            image[40 + k : 50 + k], ids[40 + k : 50 + k] = 220, 1
            made.writestr(f"cell/{k}.png", png(image))
            made.writestr(f"cell/{k}_ids.png", png(ids))
        for name, data in other.items():
            made.writestr(name.replace("__", "."), data)
    return out.getvalue()


def request(tools: Tools, data: bytes | None = None, **more) -> AdaptRequest:
    labels = UploadRef(id=tools.blobs.put(archive() if data is None else data))
    return AdaptRequest(**{"name": "cell7", "labels": labels, "minutes": 0.01} | more)


@pytest.fixture
def pretended(monkeypatch):
    """In place of the training: its report, and the network of its parent."""

    def pretend(**told):
        def learn(folder, request, parent, tools):
            shutil.copy(folder / "parent.onnx", folder / "network.onnx")
            return REPORT | told

        monkeypatch.setattr(adapt, "_learn", learn)

    return pretend


@pytest.mark.slow
def test_labelled_pictures_become_a_network_that_requests_can_name(tools):
    told = []
    tools.progress = told.append
    outcome = stages.run(request(tools), tools)
    result = outcome.result
    assert (result.trained_on, len(result.kept_aside)) == (4, 1)
    assert {"worst_1.png", "report.json"} <= outcome.files.keys()
    assert told == sorted(told)
    assert told[-1] == pytest.approx(0.97)
    assert not list(tools.training_dir.iterdir())
    # Whether a second of learning makes it better is not certain; what follows from that is.
    lost = result.general.before - result.general.after
    assert result.accepted == (result.after.dice >= result.before.dice and lost <= 1.0), result
    assert (result.model, result.version, result.in_service) == (
        ("cell7", 1, True) if result.accepted else (None, None, False)
    )
    assert tools.store.names() == (["cell7"] if result.accepted else [])
    if result.accepted:
        info = tools.store.info("cell7")
        assert (info.parent, info.owner) == (
            f"foreground_compact@{manifest()['foreground_compact'].version}",
            "a",
        )
        assert tools.weights.foreground("cell7").spec.version == "1"


def test_a_network_that_is_worse_is_not_kept(tools, pretended):
    pretended(refused="Dice on the pictures kept aside falls from 70.0 to 60.0", after=60.0)
    outcome = stages.run(request(tools, use=True), tools)
    assert (outcome.result.accepted, outcome.result.model, outcome.result.in_service) == (
        False,
        None,
        False,
    )
    assert tools.store.names() == []
    assert json.loads(outcome.files["report.json"][1])["after"] == 60.0


def test_a_further_version_serves_only_when_that_was_asked_for(tools, pretended):
    pretended()
    stages.run(request(tools), tools)
    second = stages.run(request(tools), tools).result
    assert (second.version, second.in_service) == (2, False)
    assert tools.store.find("cell7") == ("cell7", 1)
    third = stages.run(request(tools, use=True, parent="cell7@2"), tools).result
    assert (third.version, third.in_service) == (3, True)
    assert tools.store.info("cell7").parent == "cell7@2"


def test_the_same_request_finds_what_was_done_before_it_was_cut_off(tools, pretended, monkeypatch):
    """The folder of a cancelled job was another one for each job: everything began anew."""
    seen = []

    def cut_off(folder, request, parent, tools):
        seen.append((folder, (folder / "checkpoint.pt").exists()))
        (folder / "checkpoint.pt").touch()
        raise RuntimeError("killed")

    monkeypatch.setattr(adapt, "_learn", cut_off)
    labels = archive()  # packed once: a ZIP names the time
    for more in ({}, {}, {"minutes": 0.02}):
        with pytest.raises(RuntimeError):
            stages.run(request(tools, labels, **more), tools)
    assert [there for _, there in seen] == [False, True, False]
    assert seen[0][0] == seen[1][0] != seen[2][0]


BAD = {
    "no archive": (b"nothing", "is no ZIP archive"),
    "too few": (archive(4), "holds 4 pictures with a label"),
    "no picture beside it": (
        archive(lost_ids__png=png(np.zeros((9, 9), np.uint8))),
        "lost_ids.png has no picture",
    ),
    "another size": (
        archive(
            x__png=png(np.zeros((9, 9, 3), np.uint8)), x_ids__png=png(np.zeros((9, 8), np.uint8))
        ),
        "x: the picture is 9 × 9, its label 8 × 9",
    ),
    "no picture": (archive(x__jpg=b"text", x_ids__png=png(np.zeros((9, 9), np.uint8))), "x: "),
}


@pytest.mark.parametrize(("data", "why"), BAD.values(), ids=BAD)
def test_labels_that_cannot_be_used_are_named(tools, pretended, data, why):
    pretended()
    with pytest.raises(InvalidInput, match=why) as refused:
        stages.run(request(tools, data), tools)
    assert (refused.value.field, refused.value.code) == ("labels", "invalid_labels")


def test_labels_that_have_expired_are_named(tools):
    with pytest.raises(InvalidInput) as refused:
        stages.run(AdaptRequest(name="cell7", labels=UploadRef(id="0" * 64)), tools)
    assert (refused.value.field, refused.value.code) == ("labels", "unknown_labels")


@pytest.mark.parametrize(
    ("more", "field"),
    [
        ({"parent": "nowhere"}, "parent"),
        ({"name": "topology"}, "name"),
        ({"parent": "foreground_compact_int8"}, "parent"),
        ({"parent": "bright"}, "parent"),
    ],
)
def test_what_cannot_be_begun_is_refused_before_anything_is_learnt(tools, more, field):
    data = tiny.brightness()
    tools.store.add(tiny.card(data), data, "bright", "a")
    with pytest.raises(InvalidInput) as refused:
        stages.run(request(tools, **more), tools)
    assert refused.value.field == field


def test_a_training_that_crashes_is_our_fault_and_tells_why(tools, monkeypatch):
    monkeypatch.setattr(adapt, "_COMMAND", "no.such.module")
    with pytest.raises(RuntimeError, match=r"no\.such\.module|No module named 'no'"):
        stages.run(request(tools), tools)


def test_pictures_that_cannot_be_learnt_from_are_the_requests_fault(tools, monkeypatch):
    def told(command, **_):
        return subprocess.Popen(
            ["sh", "-c", """echo '{"problem": "too few"}'; exit 2"""], stdout=-1, text=True
        )

    monkeypatch.setattr(
        adapt, "subprocess", type("S", (), {"Popen": told, "PIPE": -1, "DEVNULL": -3})
    )
    with pytest.raises(InvalidInput, match="labels: too few"):
        stages.run(request(tools), tools)
