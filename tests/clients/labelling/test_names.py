"""Pictures that differ by their suffix, their folder or their case do not share an exported
file."""

from __future__ import annotations

from pathlib import Path

import pytest
from dlo_client.labelling import LabelStore, find_pictures
from dlo_client.labelling.formats import indexed_png, yolo
from dlo_client.labelling.formats.names import stem, stem_and_suffix, told_apart
from dlo_client.labelling.store import corrected_file, write_whole
from dlo_client.labelling.training_set import export_training_set
from PIL import Image

from models.synthesis.datasets import read_index
from tests.clients.labelling import drawn, foreign

ALIKE = [
    ["cam.jpg", "cam.png"],
    ["a/cam.jpg", "a/cam.JPG", "a/cam.png"],
    ["Cam.png", "cam.png"],
    ["cam.jpg", "cam.png", "cam_jpg.tif"],
    ["a/b.jpg", "a__b.jpg"],
    ["a/b.jpg", "a__b.jpg", "a__b.png", "a/b.png"],
]


@pytest.mark.parametrize("names", ALIKE)
def test_files_are_told_apart_and_named_the_same_again(names: list[str]) -> None:
    files = told_apart(names, stem, stem_and_suffix)
    assert files.keys() == set(names)
    assert len({file.casefold() for file in files.values()}) == len(names)
    assert told_apart(reversed(names), stem, stem_and_suffix) == files


def test_a_name_that_is_alone_keeps_its_form() -> None:
    assert told_apart(["a/cam.jpg", "b/cam.png"], stem, stem_and_suffix) == {
        "a/cam.jpg": "a/cam",
        "b/cam.png": "b/cam",
    }


@pytest.mark.slow
@pytest.mark.parametrize("names", ALIKE)
def test_every_picture_has_a_mask_and_a_label_of_its_own(tmp_path: Path, names: list[str]) -> None:
    """`cam.jpg` and `cam.png` wrote one file, the later over the earlier, exit code 0."""

    def labels():
        return [drawn.label(name) for name in names]

    assert len(list(indexed_png.write(labels, tmp_path).rglob("*.png"))) == len(names)
    assert len(list(yolo.write(labels, tmp_path).rglob("*.txt"))) == len(names)


@pytest.mark.parametrize(
    "names", [names for names in ALIKE if len({n.casefold() for n in names}) == len(names)]
)
def test_every_picture_is_in_the_training_set(tmp_path: Path, names: list[str]) -> None:
    """`a/b.jpg` and `a__b.jpg` were flattened to one name."""
    with foreign.store_of(tmp_path / "out", *(drawn.label(name) for name in names)) as store:
        for k, name in enumerate(names):
            write_whole(
                corrected_file(store.folder, name), drawn.label(name).model_dump_json().encode()
            )
            (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT), (k, 0, 0)).save(
                tmp_path / "in" / name, "PNG"
            )
        pictures = find_pictures(tmp_path / "in")
        assert export_training_set(store, pictures, tmp_path / "set") == {}
        assert export_training_set(store, pictures, tmp_path / "set") == {}, (
            "the second one finds all of it there"
        )
    records = read_index(tmp_path / "set")
    assert sorted(record["source"] for record in records) == sorted(names)
    colors = {
        record["source"]: Image.open(tmp_path / "set" / f"{record['name']}.png").getpixel((0, 0))
        for record in records
    }
    assert colors == {name: (k, 0, 0) for k, name in enumerate(names)}


def test_a_later_picture_does_not_take_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    """The set was exported when the name was alone."""
    for names in (["a/b.jpg"], ["a/b.jpg", "a__b.jpg"]):
        for name in names:
            (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT), (len(name), 0, 0)).save(
                tmp_path / "in" / name, "PNG"
            )
        with foreign.store_of(tmp_path / "out", *(drawn.label(name) for name in names)) as store:
            export_training_set(
                store, find_pictures(tmp_path / "in"), tmp_path / "set", corrected_only=False
            )
    assert sorted(record["source"] for record in read_index(tmp_path / "set")) == [
        "a/b.jpg",
        "a__b.jpg",
    ]
    assert len(list((tmp_path / "set").glob("*_ids.png"))) == 2


def test_an_export_replaces_what_an_earlier_one_left(tmp_path: Path) -> None:
    folder = yolo.write(lambda: [drawn.label("a.png"), drawn.label("b.png")], tmp_path)
    (folder / "runs").mkdir()
    yolo.write(lambda: [drawn.label("a.png")], tmp_path)
    assert [file.name for file in folder.rglob("*.txt")] == ["a.txt"]
    assert (folder / "runs").exists(), "what is not ours stays"


def test_the_ledger_knows_where_the_pictures_are(tmp_path: Path) -> None:
    with LabelStore(tmp_path, write=True) as store:
        assert store.source() is None
        store.remember_source("/pictures")
        assert store.source() == "/pictures"
