"""Networks that users bring: stored after they were tried, named in requests, taken up without a
restart."""

from __future__ import annotations

import io

import numpy as np
import pytest
from dlo_client.contracts import (
    ImageRef,
    ImportNetworkRequest,
    InstancesRequest,
    SegmentRequest,
    UploadRef,
)
from PIL import Image

from models.weights.inference import Runtime
from tests.workers.networks import tiny
from workers import stages
from workers.blobs import FolderBlobs
from workers.networks.store import NetworkStore
from workers.stages.outcome import InvalidInput, Tools


@pytest.fixture
def tools(settings) -> Tools:
    blobs = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s)
    return Tools(blobs, 10**7, Runtime(threads=1), store=NetworkStore.of(settings), owner="a")


def bring(tools: Tools, data: bytes, name: str | None = None):
    return stages.run(
        ImportNetworkRequest(file=UploadRef(id=tools.blobs.put(data)), name=name), tools
    ).result.network


@pytest.fixture
def picture(tools) -> ImageRef:
    """Three grays: 60, 140 and 250."""
    pixels = np.repeat(np.array([60, 140, 250], np.uint8), 32)[None, :, None] * np.ones(
        (32, 1, 3), np.uint8
    )
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    return ImageRef(id=tools.blobs.put(out.getvalue()))


def coverage(tools: Tools, picture: ImageRef, **named) -> float:
    return stages.run(SegmentRequest(image=picture, **named), tools).result.coverage


def test_a_network_that_was_brought_is_used_by_its_name_at_once(tools, picture):
    info = bring(tools, tiny.packed())
    assert (info.name, info.version, info.shipped, info.owner, info.default) == (
        "cell7",
        "1",
        False,
        "a",
        False,
    )
    result = stages.run(SegmentRequest(image=picture, model="cell7"), tools).result
    assert result.coverage == pytest.approx(2 / 3)
    assert [(m.name, m.version) for m in result.models] == [("cell7", "1")]
    assert (
        stages.run(InstancesRequest(image=picture, model="cell7"), tools).result.models[0].name
        == "cell7"
    )


def test_another_version_serves_only_when_asked_for(tools, picture):
    """A worker that has the network loaded must not go on with the version of before either."""
    bring(tools, tiny.packed())
    assert coverage(tools, picture, model="cell7") == pytest.approx(2 / 3)
    bring(tools, tiny.packed(tiny.brightness(-20.0)))
    assert coverage(tools, picture, model="cell7") == pytest.approx(2 / 3)
    assert coverage(tools, picture, model="cell7@2") == pytest.approx(1 / 3)
    tools.store.use("cell7", 2)
    assert coverage(tools, picture, model="cell7") == pytest.approx(1 / 3)
    tools.store.use("cell7", 1)
    assert coverage(tools, picture, model="cell7") == pytest.approx(2 / 3)


def test_the_default_of_a_key_and_of_the_service_serve_requests_that_name_none(tools, picture):
    bring(tools, tiny.packed())
    bring(tools, tiny.packed(tiny.brightness(-20.0), "dark"))
    assert coverage(tools, picture, default_model="dark") == pytest.approx(1 / 3)
    assert coverage(tools, picture, default_model="dark", model="cell7") == pytest.approx(2 / 3)
    tools.weights.default_model = "dark"
    assert coverage(tools, picture) == pytest.approx(1 / 3)


_MISSING = [
    ({"model": "cell8"}, "model"),
    ({"default_model": "x"}, "default_model"),
    ({"model": "cell7@3"}, "model"),
    ({"model": "topology"}, "model"),
]


@pytest.mark.parametrize(("named", "field"), _MISSING)
def test_a_network_that_is_not_there_is_named_with_those_that_are(tools, picture, named, field):
    bring(tools, tiny.packed())
    with pytest.raises(InvalidInput) as refused:
        coverage(tools, picture, **named)
    assert (refused.value.field, refused.value.code) == (field, "invalid_model")
    assert "cell7" in refused.value.message


def test_a_deleted_network_is_gone_for_workers_that_have_it_loaded(tools, picture):
    bring(tools, tiny.packed())
    coverage(tools, picture, model="cell7")
    tools.store.delete("cell7")
    with pytest.raises(InvalidInput, match="no foreground network 'cell7'"):
        coverage(tools, picture, model="cell7")


@pytest.mark.parametrize(
    ("data", "name", "field", "code"),
    [
        (b"nothing", None, "file", "invalid_network"),
        (tiny.packed(tiny.brightness(outputs=2)), None, "file", "invalid_network"),
        (tiny.packed(), "foreground_compact", "name", "name_taken"),
        (tiny.packed(name="topology"), None, "file", "name_taken"),
        (tiny.packed(), "theirs", "name", "name_taken"),
    ],
    ids=["no file", "unfit", "a shipped name", "a shipped name in the file", "another key's name"],
)
def test_what_cannot_be_taken_in_names_the_field_and_stores_nothing(tools, data, name, field, code):
    tools.owner = "b"
    bring(tools, tiny.packed(name="theirs"))
    tools.owner = "a"
    with pytest.raises(InvalidInput) as refused:
        bring(tools, data, name)
    assert (refused.value.field, refused.value.code) == (field, code)
    assert tools.store.names() == ["theirs"]
    assert len(tools.store.info("theirs").versions) == 1


def test_few_networks_of_users_stay_loaded(tools, picture):
    for k in range(7):
        bring(tools, tiny.packed(name=f"cell{k}"))
        coverage(tools, picture, model=f"cell{k}")
    assert len(tools.weights._stored) == 4
