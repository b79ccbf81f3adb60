"""The real SDK against the real service with two real workers: a photograph goes in, instances come
out."""

from __future__ import annotations

import asyncio
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from dlo_client import (
    AsyncClient,
    Client,
    InstancesRequest,
    JobFailed,
    NoopRequest,
    SegmentRequest,
    result_of,
)
from dlo_client.contracts import (
    InstancesResult,
    LabelTrackedResult,
    PlanShapeResult,
    ReconstructResult,
)
from PIL import Image

from services.examples import EXAMPLES
from tests.processes import ONE_CHILD, running_service
from workers.record import REQUEST

pytestmark = pytest.mark.system
SAMPLES = Path(__file__).parent.parent / "samples"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with running_service(tmp_path_factory.mktemp("data"), workers=2, more=ONE_CHILD) as address:
        yield address


@pytest.fixture
def client(address):
    with Client(address) as client:
        yield client


@pytest.mark.parametrize(("name", "cables"), [("plain", 4), ("busy", 4), ("industrial", 3)])
def test_the_cables_of_a_bundled_picture_are_found(client, name, cables):
    """The longest ones of each picture; the smallest pieces at the border may or may not be
    seen."""
    job = client.run_job(
        InstancesRequest(files=["instances", "overlay", "mask"]), SAMPLES / f"{name}.jpg"
    )
    result = result_of(job)
    assert (result.width, result.height) == (640, 360)
    assert len([i for i in result.instances if i.length_px > 100]) >= cables
    assert result.crossings
    for instance in result.instances:
        steps = np.hypot(*np.diff(instance.centerline_xy, axis=0).T)
        assert steps.max() < 1.2 * np.median(steps), "points lie at equal arc length"
    for file in ("instances.png", "overlay.png", "mask.png"):
        assert Image.open(BytesIO(client.file(job, file))).size == (640, 360)
    assert {"decode", "segment", "instances", "encode", "queue_wait", "total"} <= set(
        job.timings_ms
    )


def test_the_same_picture_twice_gives_the_same_bytes(client):
    jobs = [client.run_job(InstancesRequest(), SAMPLES / "busy.jpg") for _ in range(2)]
    assert jobs[0].id != jobs[1].id
    assert jobs[0].result.model_dump_json() == jobs[1].result.model_dump_json()
    assert [f.sha256 for f in jobs[0].files] == [f.sha256 for f in jobs[1].files]


def test_arrays_and_images_are_pictures_and_masks(client):
    """The same answer, whether a file, its array or its image is sent; masks come back as
    arrays."""
    path = SAMPLES / "plain.jpg"
    with Image.open(path) as image:
        answers = [client.run(InstancesRequest(), given) for given in (np.asarray(image), image)]
        assert client.upload(image).sha256 == client.upload(image.copy()).sha256
    first = answers[0]
    assert answers[0] == answers[1]
    assert len(first.instances) == len(client.run(InstancesRequest(), path).instances)
    masks = [instance.mask_rle.array() for instance in first.instances]
    assert {mask.shape for mask in masks} == {(360, 640)}
    assert sum(mask.astype(int) for mask in masks).max() == 1, "visible pixels belong to one DLO"
    foreground = np.any(masks, axis=0)
    seen = [
        client.run(InstancesRequest(), mask=given)
        for given in (foreground, Image.fromarray(foreground))
    ]
    assert seen[0] == seen[1]
    covered = np.any([instance.mask_rle.array() for instance in seen[0].instances], axis=0)
    assert (covered & foreground).sum() > 0.9 * foreground.sum()


def test_16_bit_arrays_are_pictures(client):
    with Image.open(SAMPLES / "plain.jpg") as image:
        gray = np.asarray(image.convert("L"))
    found = client.run(InstancesRequest(), gray.astype(np.uint16) * 257)
    assert len(found.instances) == len(client.run(InstancesRequest(), gray).instances) > 0


def test_a_picture_without_a_cable_has_none(client):
    buffer = BytesIO()
    Image.effect_noise((640, 360), 12).convert("RGB").save(buffer, "PNG")
    assert client.run(InstancesRequest(), buffer.getvalue()).instances == []


def test_ten_requests_at_once_are_all_right_and_none_is_lost(address):
    names = ["plain", "busy", "industrial", "plain", "busy"] * 2

    async def ask() -> list[str]:
        async with AsyncClient(address) as client:
            jobs = await asyncio.gather(
                *(client.run_job(InstancesRequest(), SAMPLES / f"{n}.jpg") for n in names)
            )
        assert len({job.id for job in jobs}) == len(names)
        return [job.result.model_dump_json() for job in jobs]

    answers = asyncio.run(ask())
    by_name = dict(zip(names, answers, strict=True))
    assert len(set(by_name.values())) == 3
    assert all(answer == by_name[name] for name, answer in zip(names, answers, strict=True))


def test_a_picture_that_cannot_be_decoded_fails_its_job_and_no_other(client):
    """Its header is whole, so that it is accepted; what the header promises is not there."""
    tiff = BytesIO()
    Image.new("RGB", (64, 64)).save(tiff, "TIFF")
    with pytest.raises(JobFailed) as caught:
        client.run(SegmentRequest(), tiff.getvalue()[:-6000])
    assert caught.value.problem.errors[0].field == "image"
    assert client.run(NoopRequest()).held_s == 0


@pytest.mark.parametrize(
    "kind", [kind for kind in EXAMPLES if kind != "adapt"]
)  # no worker trains here
def test_the_documented_example_of_a_kind_succeeds(client, kind):
    job = client.run_job(REQUEST.validate_python({"kind": kind, **EXAMPLES[kind]}))
    assert job.result.kind == kind
    match job.result:
        case InstancesResult() | LabelTrackedResult():
            assert job.result.model_dump_json().count("centerline_xy") >= 1
        case ReconstructResult():
            assert 0.1 < job.result.curve.length_m < 0.6
        case PlanShapeResult():
            assert job.result.action is not None


def test_models_and_readiness_are_those_of_the_workers(client):
    assert client.ready()
    assert {n.name for n in client.networks()} >= {"foreground_compact", "rt_dlo_orientation"}
