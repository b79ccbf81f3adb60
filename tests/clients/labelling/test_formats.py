"""Every format gives back what went in: masks to the pixel, centerlines to half a pixel."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling.formats import (
    READERS,
    WRITERS,
    FormatError,
    cvat,
    indexed_png,
    label_studio,
    yolo,
)
from dlo_client.labelling.formats.label_studio.brush import decode_brush, encode_brush
from dlo_client.labelling.formats.pixels import fill, joined, outlines

from tests.clients.labelling import drawn, foreign

FORMATS = [
    ("coco", "coco"),
    ("coco-polygons", "coco"),
    ("cvat", "cvat"),
    ("label-studio", "label-studio"),
    ("json",) * 2,
]


def _labels():
    return [
        drawn.label(),
        drawn.label("other & <more>.jpg").model_copy(update={"instances": [], "crossings": []}),
    ]


@pytest.mark.parametrize(("writer", "reader"), FORMATS)
def test_labels_come_back_whole(tmp_path: Path, writer: str, reader: str) -> None:
    file = WRITERS[writer](_labels, tmp_path)
    imported = READERS[reader](foreign.annotated(file) if reader == "label-studio" else file)
    assert imported.problems == imported.notes == {}
    back, true = imported.labels[0], drawn.label()
    assert [label.name for label in imported.labels] == [drawn.NAME, "other & <more>.jpg"]
    assert [i.id for i in back.instances] == [1, 2, 3]
    for got, want in zip(back.instances, true.instances, strict=True):
        assert np.array_equal(drawn.mask(got), drawn.mask(want))
        assert np.abs(np.array(got.centerline_xy) - np.array(want.centerline_xy)).max() <= 0.5
        assert (got.width_px, got.closed) == (want.width_px, want.closed)
    crossing = back.crossings[0]
    assert (crossing.over, crossing.under) == (true.crossings[0].over, true.crossings[0].under)
    assert np.abs(np.subtract(crossing.xy, true.crossings[0].xy)).max() <= 0.5


def test_our_own_format_loses_nothing(tmp_path: Path) -> None:
    assert READERS["json"](WRITERS["json"](_labels, tmp_path)).labels == _labels()


def test_yolo_polygons_fill_to_the_same_masks(tmp_path: Path) -> None:
    """Also as Ultralytics draws them: coordinates cut to whole pixels, outline included."""
    import cv2

    folder = yolo.write(_labels, tmp_path)
    files = {file.name: file for file in (folder / "labels").rglob("*.txt")}
    text = files["shelf 2__näh bild.txt"].read_text()
    found = yolo.masks_of(text, drawn.HEIGHT, drawn.WIDTH)
    for got, item in zip(found, drawn.label().instances, strict=True):
        assert np.array_equal(got, drawn.mask(item))
    whole = np.array(text.splitlines()[0].split()[1:], float).reshape(-1, 2) * (
        drawn.WIDTH,
        drawn.HEIGHT,
    )
    canvas = np.zeros((drawn.HEIGHT, drawn.WIDTH), np.uint8)
    cv2.fillPoly(canvas, [whole.astype(np.int32)], 1)
    assert np.array_equal(canvas > 0, drawn.mask(drawn.label().instances[0]))
    assert files["other & <more>.txt"].read_text() == ""
    assert "0: dlo" in (folder / "dataset.yaml").read_text()


def test_an_indexed_png_holds_the_ids(tmp_path: Path) -> None:
    folder = indexed_png.write(_labels, tmp_path)
    ids = indexed_png.read_png((folder / "shelf 2" / "näh bild.png").read_bytes())
    for item in drawn.label().instances:
        assert np.array_equal(ids == item.id, drawn.mask(item))


def test_an_indexed_png_refuses_what_does_not_fit() -> None:
    label = drawn.label()
    many = label.model_copy(
        update={"instances": [label.instances[0].model_copy(update={"id": 256})]}
    )
    with pytest.raises(FormatError, match="256"):
        indexed_png.ids_of(many)


@pytest.mark.parametrize("seed", range(6))
def test_outlines_fill_to_the_mask_they_were_taken_from(seed: int) -> None:
    """Noise has holes, diagonal contacts and pixels at the border."""
    mask = np.random.default_rng(seed).random((23, 31)) < (0.1, 0.3, 0.5, 0.6, 0.8, 0.97)[seed]
    assert np.array_equal(fill(outlines(mask), 23, 31), mask)
    assert np.array_equal(fill([joined(outlines(mask))], 23, 31), mask)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_brushes_come_back(share: float) -> None:
    mask = np.random.default_rng(3).random((200, 180)) < share
    assert np.array_equal(decode_brush(encode_brush(mask), 200, 180), mask)


def test_a_brush_is_read_bit_by_bit() -> None:
    """Written by hand: 2 × 1 pixels, the first set; a repeated run of 4 and a run of 4 single
    values."""
    bits = f"{8:032b}" + "00111" + "0010001101111111" + "10001111111111" + "000011" + "0" * 32
    bits += "0" * (-len(bits) % 8)
    data = [int(bits[k : k + 8], 2) for k in range(0, len(bits), 8)]
    assert decode_brush(data, 1, 2).tolist() == [[True, False]]
    with pytest.raises(ValueError, match="cut short"):
        decode_brush(data[:-3], 1, 2)
    with pytest.raises(ValueError, match="for a picture"):
        decode_brush(data, 2, 2)


def test_cvat_masks_are_rows_within_their_box(tmp_path: Path) -> None:
    """By hand, as CVAT's documentation has it: background first, row by row, within the box."""
    xml = """<annotations><version>1.1</version><image id="0" name="a.png" width="5" height="4">
      <mask label="dlo" rle="1, 2, 1, 2" left="1" top="1" width="3" height="2"></mask></image></annotations>"""
    file = tmp_path / "hand.xml"
    file.write_text(xml)
    (label,) = cvat.read(file).labels
    assert drawn.mask(label.instances[0])[1:3, 1:4].tolist() == [
        [False, True, True],
        [False, True, True],
    ]
    assert drawn.mask(label.instances[0]).sum() == 4


def test_what_a_person_adds_in_cvat_is_an_instance_of_its_own(tmp_path: Path) -> None:
    xml = """<annotations><version>1.1</version><image id="0" name="a.png" width="40" height="30">
      <polyline label="dlo" points="2.5,10.5;30.5,10.5"></polyline>
      <polygon label="dlo" points="5,20;15,20;15,25;5,25"></polygon></image></annotations>"""
    file = tmp_path / "hand.xml"
    file.write_text(xml)
    (label,) = cvat.read(file).labels
    line, polygon = label.instances
    assert line.centerline_xy == [(2.0, 10.0), (30.0, 10.0)]
    assert drawn.mask(line)[10, 2:31].all()
    assert drawn.mask(polygon).sum() == 50
    assert {line.id, polygon.id} == {1, 2}


def test_label_studio_is_read_as_it_exports(tmp_path: Path) -> None:
    """An annotation wins over the prediction; a deleted crossing is gone; a new brush is a new
    instance."""
    label_studio.write(_labels, tmp_path)
    tasks = json.loads((tmp_path / "label_studio.json").read_text())
    kept = [
        r for r in tasks[0]["predictions"][0]["result"] if not re.match("dlo-2|crossing", r["id"])
    ]
    added = {**kept[0], "id": "xYz", "meta": None}
    tasks[0]["annotations"] = [
        {"updated_at": "2026-01-02", "result": [*kept, added]},
        {"updated_at": "2026-01-03", "was_cancelled": True, "result": []},
    ]
    (tmp_path / "export.json").write_text(json.dumps(tasks))
    back = label_studio.read(tmp_path / "export.json").labels[0]
    assert [i.id for i in back.instances] == [1, 3, 4]
    assert np.array_equal(drawn.mask(back.instances[2]), drawn.mask(drawn.label().instances[0]))
    assert back.crossings == []


@pytest.mark.parametrize("reader", ["coco", "cvat", "label-studio", "json"])
def test_a_broken_picture_costs_no_other(tmp_path: Path, reader: str) -> None:
    file = WRITERS[reader](_labels, tmp_path)
    text = (foreign.annotated(file) if reader == "label-studio" else file).read_text()
    broken = {
        "coco": text.replace('"counts": "', '"counts": "~', 1),
        "cvat": text.replace('rle="', 'rle="7, ', 1),
        "label-studio": text.replace('"rle": [0', '"rle": [9'),
        "json": text.replace('"width"', '"with"', 1),
    }[reader]
    assert broken != text
    file.write_text(broken)
    imported = READERS[reader](file)
    assert [label.name for label in imported.labels] == ["other & <more>.jpg"]
    assert len(imported.problems) == 1


@pytest.mark.parametrize("reader", ["coco", "cvat", "label-studio"])
def test_another_file_is_refused(tmp_path: Path, reader: str) -> None:
    file = tmp_path / "wrong"
    file.write_text("[1" if reader == "label-studio" else "{}")
    with pytest.raises(FormatError):
        READERS[reader](file)


def test_entities_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "bomb.xml"
    file.write_text('<!DOCTYPE a [<!ENTITY b "c">]><annotations/>')
    with pytest.raises(FormatError, match="entities"):
        cvat.read(file)
