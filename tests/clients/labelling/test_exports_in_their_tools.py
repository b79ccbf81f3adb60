"""Every export is opened by the libraries of the tools that it is for: as it was written, from
another folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dlo_client.labelling import find_pictures
from dlo_client.labelling.formats import WRITERS
from PIL import Image
from pycocotools.coco import COCO

from tests.clients.labelling import drawn, foreign

pytestmark = pytest.mark.slow

NAMES = ["cam.jpg", "cam.png", "shelf 2/näh bild.png", "images/a.png", "b.jfif", "c.png"]


def labels():
    return [drawn.label(name) for name in NAMES]


def of_one_suffix():
    """Without `cam.jpg`: datumaro names pictures without their suffix."""
    return labels()[1:]


@pytest.fixture
def out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for the exports beside one of pictures; the tools are started elsewhere."""
    for name in NAMES:
        file = tmp_path / "pictures" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.random.default_rng(len(name)).integers(
            0, 255, (drawn.HEIGHT, drawn.WIDTH, 3), np.uint8
        )
        Image.fromarray(pixels).save(file, "PNG" if name.endswith("png") else "JPEG")
    (tmp_path / "elsewhere" / "images").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def yolo(out: Path) -> Path:
    problems: dict[str, str] = {}
    pictures = {picture.name: picture for picture in find_pictures(out.parent / "pictures")}
    folder = WRITERS["yolo"](labels, out, pictures, problems)
    assert problems == {}
    return folder


def areas() -> list[int]:
    return [int(drawn.mask(item).sum()) for item in drawn.label().instances]


def test_ultralytics_loads_the_yolo_export(out: Path, tmp_path: Path) -> None:
    """`path: .` was looked for in the working folder, there were no pictures, and training was
    validated on itself."""
    folder = yolo(out)
    script = Path(__file__).with_name("load_with_ultralytics.py")
    environment = {**os.environ, "YOLO_CONFIG_DIR": str(tmp_path), "YOLO_OFFLINE": "true"}
    command = [sys.executable, str(script), str(folder / "dataset.yaml")]
    run = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    found = json.loads(run.stdout.splitlines()[-1])
    assert found["names"] == [[0, "dlo"]]
    pictures = [*found["train"], *found["val"]]
    assert {picture["segments"] for picture in pictures} == {3}
    assert {tuple(picture["shape"]) for picture in pictures} == {(drawn.HEIGHT, drawn.WIDTH)}
    train, val = ({picture["file"] for picture in found[side]} for side in ("train", "val"))
    assert len(pictures) == len(train | val) == len(NAMES)
    assert val
    assert not train & val


def test_supervision_loads_the_yolo_export(out: Path) -> None:
    import supervision

    folder, count = yolo(out), 0
    for side in ("train", "val"):
        parts = (folder / part / side for part in ("images", "labels"))
        dataset = supervision.DetectionDataset.from_yolo(
            *map(str, parts), str(folder / "dataset.yaml"), force_masks=True
        )
        assert dataset.classes == ["dlo"]
        for _, _, found in dataset:
            assert found.mask.shape == (3, drawn.HEIGHT, drawn.WIDTH)
            count += 1
    assert count == len(NAMES), "it does not look into folders below"


@pytest.mark.parametrize("form", ["coco", "coco-polygons"])
def test_pycocotools_loads_coco(out: Path, form: str) -> None:
    coco = COCO(str(WRITERS[form](labels, out)))
    assert [coco.loadImgs(k)[0]["file_name"] for k in coco.getImgIds()] == NAMES
    found = coco.loadAnns(coco.getAnnIds(imgIds=[1], catIds=coco.getCatIds(["dlo"])))
    assert [int(coco.annToMask(each).sum()) for each in found] == areas()


def test_supervision_loads_coco(out: Path) -> None:
    import supervision

    file = WRITERS["coco"](labels, out)
    dataset = supervision.DetectionDataset.from_coco(
        str(out.parent / "pictures"), str(file), force_masks=True
    )
    assert dataset.classes == ["dlo"]
    assert len(dataset) == len(NAMES)
    _, _, first = dataset[0]
    assert first.mask.sum((1, 2)).tolist() == areas()


@pytest.mark.parametrize("form", ["coco", "coco-polygons"])
def test_datumaro_loads_coco(out: Path, form: str) -> None:
    """Datumaro wants annotations in a folder of that name, beside the pictures in `images`."""
    from datumaro.components.dataset import Dataset

    (out / "annotations").mkdir()
    shutil.copytree(out.parent / "pictures", out / "images")
    shutil.copy(WRITERS[form](of_one_suffix, out), out / "annotations" / "instances_train.json")
    dataset = Dataset.import_from(str(out), "coco_instances")
    assert len(dataset) == len(NAMES) - 1
    assert all(len(item.annotations) >= 3 for item in dataset)


def test_datumaro_loads_cvat(out: Path) -> None:
    """It refused a file whose labels stood in `<meta><job>`. Pictures lie in `images` beside it, as
    CVAT packs them."""
    from datumaro.components.dataset import Dataset

    file = WRITERS["cvat"](of_one_suffix, out)
    shutil.copytree(out.parent / "pictures", out / "images")
    dataset = Dataset.import_from(str(file), "cvat")
    assert len(dataset) == len(NAMES) - 1
    groups: dict[int, list[str]] = {}
    for each in next(iter(dataset)).annotations:
        groups.setdefault(each.group, []).append(type(each).__name__)
    assert {1, 2, 3} <= groups.keys()


def test_label_studio_reads_the_tasks_and_their_brushes(out: Path) -> None:
    from label_studio_sdk.converter import Converter, brush

    file = foreign.annotated(WRITERS["label-studio"](labels, out))
    converter = Converter(
        str(out / "label_studio.xml"), project_dir=str(out), upload_dir=str(out.parent / "pictures")
    )
    tasks: list[dict[str, Any]] = json.loads(file.read_text())
    for number, task in enumerate(tasks):
        task["id"] = number
    file.write_text(json.dumps(tasks))
    converter.convert_to_json(str(file), str(out / "converted"), is_dir=False)
    converted = json.loads((out / "converted" / "result.json").read_text())
    assert len(converted) == len(NAMES)
    brushes = [
        r["value"]["rle"]
        for r in tasks[0]["annotations"][0]["result"]
        if r["type"] == "brushlabels"
    ]
    alpha = [
        brush.decode_rle(rle).reshape(drawn.HEIGHT, drawn.WIDTH, 4)[:, :, 3] for rle in brushes
    ]
    assert [int((a > 0).sum()) for a in alpha] == areas()
