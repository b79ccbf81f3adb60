"""``/v1/unsure``: a key's own pictures, and only of requests that allow it."""

from __future__ import annotations

import io

import numpy as np
import pytest
from dlo_client.contracts import ImageRef, InstancesRequest
from PIL import Image
from starlette.testclient import TestClient

from models.weights.inference import Runtime
from services.app import create_app
from tests.services import samples
from tests.services.test_keys import as_, entry
from tests.workers.networks import tiny
from workers import stages
from workers.blobs import FolderBlobs
from workers.networks.store import NetworkStore
from workers.stages.outcome import Tools
from workers.unsure import UnsureStore


@pytest.fixture
def keyed(service_settings, tmp_path):
    file = tmp_path / "keys.toml"
    file.write_text("\n".join([entry("cell", keep_if_unsure=True), entry("other")]))
    with TestClient(
        create_app(service_settings.model_copy(update={"api_keys_file": file}))
    ) as client:
        yield client


def test_a_key_gets_its_own_pictures_and_forgets_them(keyed, settings):
    UnsureStore.of(settings).offer("cell", b"picture", 0.25, "nothing was found")
    [found] = keyed.get("/v1/unsure", headers=as_("cell")).json()
    assert (found["certainty"], found["doubt"]) == (0.25, "nothing was found")
    path = f"/v1/unsure/{found['id']}"
    assert keyed.get("/v1/unsure", headers=as_("other")).json() == []
    assert keyed.get(path, headers=as_("other")).json()["code"] == "unknown_picture"
    assert keyed.get(path, headers=as_("cell")).content == b"picture"
    assert keyed.delete(path, headers=as_("cell")).status_code == 204
    assert keyed.delete(path, headers=as_("cell")).status_code == 404


def test_the_key_decides_unless_the_request_does(keyed, job_queue):
    image = keyed.post("/v1/images", content=samples.encoded(), headers=as_("cell")).json()["id"]
    kept = []
    for name, more in (("cell", {}), ("other", {}), ("cell", {"keep_if_unsure": False})):
        request = {"kind": "instances", "image": {"id": image}} | more
        job = keyed.post("/v1/jobs", json=request, headers=as_(name)).json()["id"]
        kept.append('"keep_if_unsure":true' in job_queue._client.hget(f"dlo:job:{job}", "request"))
    assert kept == [True, False, False]


def test_a_job_keeps_its_picture_only_when_it_may(settings):
    blobs, unsure = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s), UnsureStore.of(settings)
    store, data = NetworkStore.of(settings), tiny.brightness()
    store.add(tiny.card(data), data, "cell7", "a")
    tools = Tools(blobs, 10**7, Runtime(threads=1), store=store, owner="a", unsure=unsure)
    out = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 90, (64, 64, 3), dtype=np.uint8)).save(
        out, "PNG"
    )
    image = ImageRef(id=blobs.put(out.getvalue()))
    for allowed in (False, True):
        stages.run(
            InstancesRequest(image=image, model="cell7", files=[], keep_if_unsure=allowed), tools
        )
        assert len(unsure.listed("a")) == int(allowed)
    assert unsure.listed("a")[0].certainty == 0.0
    assert unsure.picture("a", unsure.listed("a")[0].id) == out.getvalue()
