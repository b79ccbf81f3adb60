"""`dlo label` against the real service, killed with SIGKILL again and again: every picture is
labelled exactly once."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from dlo_client import Client
from dlo_client.labelling import LabelStore
from PIL import Image

from models.geometry.rle import decode
from tests.benchmarks.tracked_scenes import tracked_scene
from tests.processes import ONE_CHILD, running_service

pytestmark = pytest.mark.system
SAMPLES = Path(__file__).parent.parent / "samples"
PICTURES = 40
KILLS = 10


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with running_service(tmp_path_factory.mktemp("data"), workers=1, more=ONE_CHILD) as address:
        yield address


def fill(folder: Path, count: int) -> None:
    """Cuts of a sample, small so that many are done in little time; no two alike."""
    source = Image.open(SAMPLES / "plain.jpg").convert("RGB")
    folder.mkdir()
    for k in range(count):
        left, top = 10 * (k % 40), 7 * (k % 20)
        cut = source.crop((left, top, left + 160, top + 128))
        cut.putpixel((0, 0), (k % 256, k // 256, 7))
        cut.save(folder / f"picture {k:04d}.png")


def dlo(address: str, *arguments: object) -> list[str]:
    """A command line of ``dlo``."""
    program = "from dlo_client.commands.cli import main; main()"
    return [
        sys.executable,
        "-c",
        program,
        "--url",
        address,
        *(str(argument) for argument in arguments),
    ]


def command(address: str, source: Path, out: Path, *more: str) -> list[str]:
    return dlo(address, "label", source, "--out", out, *more)


def run_killed(arguments: list[str], rng: random.Random, after_s: tuple[float, float]) -> bool:
    """Start the command and kill it after a while; whether it had ended by itself."""
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        process.wait(timeout=rng.uniform(*after_s))
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
        return False
    return True


def labelled_jobs(address: str) -> list[str]:
    """Labels of all jobs that the service has done: the names of the pictures."""
    with Client(address) as client:
        return [job.label for job in client.jobs(kind="instances") if job.label]


def test_killed_ten_times_every_picture_is_labelled_exactly_once(address, tmp_path):
    source, out = tmp_path / "in", tmp_path / "out"
    fill(source, PICTURES)
    (source / "broken.png").write_bytes(b"no picture")
    rng = random.Random(5)
    arguments = command(address, source, out, "--at-once", "2")
    for _ in range(KILLS):
        run_killed(arguments, rng, (0.7, 1.6))
    done = subprocess.run(
        [*arguments, "--format", "coco", "--format", "json"], capture_output=True, text=True
    )
    assert done.returncode == 1, "one picture is broken"
    assert "broken.png" in done.stdout
    with LabelStore(out) as store:
        names = [label.name for label in store.labels()]
        assert list(store.entries()) == sorted([*names, "broken.png"])
    assert names == [f"picture {k:04d}.png" for k in range(PICTURES)]
    assert not list(out.rglob("*.part"))
    images = json.loads((out / "coco.json").read_text())["images"]
    assert [image["file_name"] for image in images] == names
    assert len((out / "labels.jsonl").read_text().splitlines()) == PICTURES
    jobs = [name for name in labelled_jobs(address) if name != "broken.png"]
    assert sorted(jobs) == names, "the service did no picture twice"


def test_labels_are_what_the_service_says(address, tmp_path):
    with Client(address) as client:
        from dlo_client import InstancesRequest

        said = client.run(InstancesRequest(), SAMPLES / "busy.jpg")
    command_line = command(address, SAMPLES / "busy.jpg", tmp_path / "out", "--format", "png")
    subprocess.run(command_line, check=True, capture_output=True)
    with LabelStore(tmp_path / "out") as store:
        label = store.label("busy.jpg")
    assert [i.mask_rle for i in label.instances] == [i.mask_rle for i in said.instances]
    ids = np.asarray(Image.open(BytesIO((tmp_path / "out" / "masks" / "busy.png").read_bytes())))
    assert set(np.unique(ids)) == {0, *(i.id for i in said.instances)}


def test_time_is_not_lost_on_a_second_run(address, tmp_path):
    source = tmp_path / "in"
    fill(source, 3)
    arguments = command(address, source, tmp_path / "out")
    subprocess.run(arguments, check=True, capture_output=True)
    before = len(labelled_jobs(address))
    done = subprocess.run(arguments, check=True, capture_output=True, text=True)
    assert "0 labelled now, 3 before" in done.stdout
    assert len(labelled_jobs(address)) == before


def test_tracked_strokes_label_every_picture(address, tmp_path):
    """Rendered views, clicks with a hand's errors and a calibration that is off: masks of all
    views, in COCO too."""
    scene = tracked_scene(1, views=4)
    cameras, pictures = [], []
    for k, (image, camera) in enumerate(zip(scene.images, scene.cameras, strict=True)):
        i = camera.intrinsics
        intrinsics = {
            "width": i.width,
            "height": i.height,
            "fx": i.fx,
            "fy": i.fy,
            "cx": i.cx,
            "cy": i.cy,
        }
        cameras.append({"intrinsics": intrinsics, "T_world_camera": camera.T_world_camera.tolist()})
        pictures.append(tmp_path / f"view {k}.png")
        Image.fromarray(image).save(pictures[-1])
    strokes = [
        {"points_m": points.tolist(), "thickness_m": thick}
        for points, thick in zip(scene.strokes_m, scene.thickness_m, strict=True)
    ]
    files = {"cameras.json": cameras, "strokes.json": strokes}
    for name, content in files.items():
        (tmp_path / name).write_text(json.dumps(content))
    given = [*(tmp_path / name for name in files), *pictures]
    asked = dlo(address, "label-tracked", *given, "--out", tmp_path / "out", "--format", "coco")
    done = subprocess.run(asked, check=True, capture_output=True, text=True)
    assert "view 3.png: 2 cables, moved by" in done.stdout
    with LabelStore(tmp_path / "out") as store:
        labels = list(store.labels())
    overlaps = []
    for label, true in zip(labels, scene.ids, strict=True):
        for item in label.instances:
            mask = decode(item.mask_rle.counts, item.mask_rle.size)
            overlaps.append((mask & (true == item.id)).sum() / (mask | (true == item.id)).sum())
    assert np.mean(overlaps) > 0.75
    assert len(json.loads((tmp_path / "out" / "coco.json").read_text())["annotations"]) == 8
