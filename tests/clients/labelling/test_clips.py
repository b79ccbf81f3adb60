"""``dlo label VIDEO``: one corrected picture labels the clip, in both directions, under its ids."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from dlo_client import Client
from dlo_client.commands import labelling_commands
from dlo_client.contracts import ImageRef, InstancesRequest, InstancesResult, MaskRLE
from dlo_client.labelling import LabelledInstance, LabelStore, PictureLabel, StoreError
from dlo_client.labelling.clips import label_clip
from dlo_client.labelling.formats.pixels import encode
from dlo_client.labelling.report import Report
from dlo_client.labelling.store import corrected_file, write_whole
from PIL import Image
from typer.testing import CliRunner

from models.weights.inference import Runtime
from workers.blobs import FolderBlobs
from workers.stages import instances
from workers.stages.outcome import Tools

FRAMES, MIDDLE = 9, 4
REQUEST = InstancesRequest(files=[])


class Service:
    """The stage itself, with what is bright as foreground: no network has to run."""

    def __init__(self, folder: Path) -> None:
        blobs = FolderBlobs(folder, 3600.0)
        self.tools = Tools(blobs, 1_000_000, Runtime(["CPUExecutionProvider"], 1, spinning=False))
        self.asked: list[InstancesRequest] = []

    def run(self, request: InstancesRequest, data: bytes, **_: object) -> InstancesResult:
        self.asked.append(request)
        pixels = np.asarray(Image.open(io.BytesIO(data)).convert("L"))
        mask = io.BytesIO()
        Image.fromarray(((pixels > 128) * 255).astype(np.uint8)).save(mask, "PNG")
        given = request.model_copy(
            update={"mask": ImageRef(id=self.tools.blobs.put(mask.getvalue()))}
        )
        return instances.run(given, self.tools).result


@pytest.fixture
def service(tmp_path: Path) -> Service:
    return Service(tmp_path / "blobs")


def true_masks(t: int) -> list[np.ndarray]:
    """Two cables that come near one another and part again."""
    masks = []
    for y in (40 + 2 * t, 90 - t):
        drawn = np.zeros((120, 200), np.uint8)
        cv2.line(drawn, (20 + 2 * t, y), (160 + 2 * t, y + 8), 1, 7)
        masks.append(drawn > 0)
    return masks


def picture(t: int) -> np.ndarray:
    return np.repeat(255 * np.logical_or(*true_masks(t)).astype(np.uint8)[..., None], 3, 2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for t in range(FRAMES):
        write_whole(tmp_path / "clip" / f"{t}.png", cv2.imencode(".png", picture(t))[1].tobytes())
    return tmp_path / "clip"


def confirm(out: Path, name: str, t: int, **changed: Any) -> PictureLabel:
    """As the corrector files it: the cables of frame ``t``, under ids of somebody's own."""
    items = [
        LabelledInstance(
            id=number,
            centerline_xy=[(20.0 + 2 * t, float(y)), (160.0 + 2 * t, y + 8.0)],
            width_px=8.0,
            mask_rle=encode(mask),
        ).model_copy(update=changed)
        for number, y, mask in zip((7, 5), (40 + 2 * t, 90 - t), true_masks(t), strict=True)
    ]
    label = PictureLabel(name=name, width=200, height=120, instances=items, origin="corrected")
    write_whole(corrected_file(out, name), label.model_dump_json().encode())
    return label


def run(service: Service, source: Path, out: Path, every: int = 1) -> Report:
    return label_clip(str(source), out, service, REQUEST, every=every, progress=lambda *_: None)


def labels(out: Path) -> list[PictureLabel]:
    with LabelStore(out) as store:
        return list(store.labels())


def overlap(rle: MaskRLE, true: np.ndarray) -> float:
    found = rle.array()
    return float((found & true).sum() / (found | true).sum())


def test_one_corrected_picture_labels_those_before_and_after_it(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run(service, folder, out)
    corrected = confirm(out, f"{MIDDLE}.png", MIDDLE)
    report = run(service, folder, out)
    assert (report.labelled, report.already, report.failed) == (FRAMES - 1, 1, {})
    found = labels(out)
    assert found[MIDDLE] == corrected
    for t, label in enumerate(found):
        by_id = {item.id: item for item in label.instances}
        assert sorted(by_id) == [5, 7]
        for number, true in zip((7, 5), true_masks(t), strict=True):
            assert overlap(by_id[number].mask_rle, true) > 0.85
    assert {label.origin for k, label in enumerate(found) if k != MIDDLE} == {"tracked"}


def test_no_pixel_has_two_cables(service: Service, folder: Path, tmp_path: Path) -> None:
    run(service, folder, tmp_path / "out")
    for label in labels(tmp_path / "out"):
        assert sum(item.mask_rle.array().astype(int) for item in label.instances).max() == 1


def test_each_picture_follows_from_the_nearest_that_is_corrected(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run(service, folder, out)
    confirm(out, "0.png", 0)
    confirm(out, "8.png", 8)
    service.asked.clear()
    run(service, folder, out)
    assert len(service.asked) == FRAMES - 2
    starts = [request.previous for request in service.asked if request.previous.frame == 1]
    assert [cable.xy[0][0] for start in starts for cable in start.cables] == [20, 20, 36, 36]


def test_what_the_corrected_picture_does_not_show_is_looked_at_first(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    more = picture(7)
    cv2.line(more, (30, 12), (170, 12), (255, 255, 255), 7)
    write_whole(folder / "7.png", cv2.imencode(".png", more)[1].tobytes())
    run(service, folder, tmp_path / "out")
    confirm(tmp_path / "out", "4.png", 4)
    report = run(service, folder, tmp_path / "out")
    name, certainty, why = report.uncertain[0]
    assert name == "7.png"
    assert certainty <= 0.5
    assert "instance 8" in why


def test_a_picture_that_cannot_be_read_keeps_no_other_from_its_label(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    (folder / "3.png").unlink()
    (folder / "3.png").symlink_to(tmp_path / "nowhere.png")
    report = run(service, folder, tmp_path / "out")
    assert list(report.failed) == ["3.png"]
    assert [label.name for label in labels(tmp_path / "out")] == [
        f"{t}.png" for t in range(FRAMES) if t != 3
    ]


def test_a_corrected_cable_without_a_centerline_is_named(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    run(service, folder, tmp_path / "out")
    confirm(tmp_path / "out", "4.png", 4, centerline_xy=[])
    with pytest.raises(ValueError, match=r"4\.png: instance 7 has no centerline"):
        run(service, folder, tmp_path / "out")


def test_a_folder_holds_the_labels_of_one_way_only(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    run(service, folder, tmp_path / "out")
    with pytest.raises(StoreError, match="take another folder"):
        run(service, folder, tmp_path / "out", every=2)


def test_a_video_from_the_command_line(
    service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film, out = tmp_path / "film.mp4", tmp_path / "out"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, (200, 120))
    for t in range(FRAMES):
        writer.write(picture(t))
    writer.release()
    monkeypatch.setattr(Client, "run", lambda _, *given, **more: service.run(*given, **more))
    arguments = ["label", str(film), "--out", str(out), "--every", "2", "--format", "coco"]
    done = CliRunner().invoke(labelling_commands.app, arguments)
    assert done.exit_code == 0, done.output
    assert "5 pictures: 5 labelled now" in done.output
    names = [f"frame_{t:06d}.png" for t in range(0, FRAMES, 2)]
    assert [label.name for label in labels(out)] == names
    assert sorted(file.name for file in (out / "pictures").iterdir()) == names
    with LabelStore(out) as store:
        assert store.source() == str(out / "pictures")


def test_a_video_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        labelling_commands.app, ["label", str(tmp_path / "no.mp4"), "--out", str(tmp_path / "o")]
    )
    assert done.exit_code == 1
    assert "no.mp4" in done.output
    assert isinstance(done.exception, SystemExit)
