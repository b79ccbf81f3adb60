"""Labels as the archive of an ``adapt`` job: from our folder and from other tools; what is left out
is named."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling import LabelStore, PictureLabel, StoreError
from dlo_client.labelling.adaptation import pack_foreign, pack_store
from dlo_client.labelling.formats import WRITERS, Wanted
from dlo_client.labelling.formats.pixels import decode
from dlo_client.labelling.store import Entry, corrected_file, write_whole
from PIL import Image

from tests.clients.labelling import drawn
from workers.labelled_pictures import pairs_of

NAMES = [f"shelf {k}/näh bild.jpg" for k in range(7)]
DRAWN = drawn.label()


def label(name: str) -> PictureLabel:
    return DRAWN.model_copy(update={"name": name})


@pytest.fixture
def source(tmp_path: Path) -> Path:
    for k, name in enumerate(NAMES):
        buffer = io.BytesIO()
        Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT), (20 * k, 50, 25)).save(buffer, "PNG")
        write_whole(tmp_path / "in" / name, buffer.getvalue())
    return tmp_path / "in"


@pytest.fixture
def folder(tmp_path: Path, source: Path) -> Path:
    """All pictures labelled, the first five corrected."""
    with LabelStore(tmp_path / "out", write=True) as store:
        store.remember_source(str(source))
        for k, name in enumerate(NAMES):
            store.put(Entry(name, "done"), label(name))
            if k < 5:
                better = label(name).model_copy(update={"origin": "corrected"})
                write_whole(corrected_file(store.folder, name), better.model_dump_json().encode())
    return tmp_path / "out"


def true_mask() -> np.ndarray:
    return np.any([decode(i.mask_rle) for i in DRAWN.instances], axis=0)


def test_corrected_labels_and_their_pictures_are_what_the_service_takes(folder: Path) -> None:
    packed = pack_store(folder)
    assert (packed.names, packed.problems) == (NAMES[:5], {})
    pairs = pairs_of(packed.archive)
    assert len(pairs) == 5
    with zipfile.ZipFile(io.BytesIO(packed.archive)) as archive:
        ids = np.asarray(Image.open(archive.open(pairs[2].ids)))
        picture = Image.open(archive.open(pairs[2].picture))
        assert picture.size == (drawn.WIDTH, drawn.HEIGHT)
        assert abs(picture.getpixel((3, 3))[0] - 40) <= 3
    assert np.array_equal(ids > 0, true_mask())
    assert (
        pack_store(folder).archive == packed.archive
    )  # the same request again goes on where it was


def test_labels_that_nobody_corrected_only_when_they_are_wanted(folder: Path) -> None:
    assert pack_store(folder, everything=True).names == NAMES


@pytest.mark.parametrize("tool", ["coco", "json", "cvat"])
def test_labels_of_another_tool_find_their_pictures(
    folder: Path, source: Path, tmp_path: Path, tool: str
) -> None:
    labels = [label(name).model_copy(update={"origin": "corrected"}) for name in NAMES]
    file = WRITERS[tool](lambda: labels, tmp_path / "theirs")
    packed = pack_foreign(file, tool, str(source), Wanted())
    assert sorted(packed.names) == NAMES, packed.problems
    assert len(pairs_of(packed.archive)) == 7


def test_labels_that_nobody_confirmed_are_named_and_left_out(source: Path, tmp_path: Path) -> None:
    file = WRITERS["json"](lambda: [label(name) for name in NAMES], tmp_path / "theirs")
    packed = pack_foreign(file, "json", str(source), Wanted())
    assert packed.names == []
    assert set(packed.problems) == set(NAMES)
    tasks = WRITERS["label-studio"](lambda: [label(name) for name in NAMES], tmp_path / "theirs")
    assert len(pack_foreign(tasks, "label-studio", str(source), Wanted()).problems) == 7


def test_a_picture_that_is_gone_or_of_another_size_is_named_and_left_out(
    folder: Path, source: Path
) -> None:
    (source / NAMES[0]).unlink()
    Image.new("RGB", (9, 9)).save(source / NAMES[1], "PNG")
    packed = pack_store(folder)
    assert packed.names == NAMES[2:5]
    assert "no longer in the source" in packed.problems[NAMES[0]]
    assert "is 9×9 now" in packed.problems[NAMES[1]]


def test_large_pictures_travel_reduced_with_their_labels(tmp_path: Path) -> None:
    from dlo_client.labelling import adaptation
    from dlo_client.labelling.sources import find_pictures

    image = Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT))
    image.save(tmp_path / "a.png")
    adaptation_px, adaptation._LONGEST_PX = adaptation._LONGEST_PX, drawn.WIDTH // 2
    try:
        packed = adaptation.pack([label("a.png")], {p.name: p for p in find_pictures(tmp_path)})
    finally:
        adaptation._LONGEST_PX = adaptation_px
    with zipfile.ZipFile(io.BytesIO(packed.archive)) as archive:
        assert {Image.open(archive.open(name)).size for name in archive.namelist()} == {
            (drawn.WIDTH // 2, drawn.HEIGHT // 2)
        }


def test_a_folder_that_does_not_know_its_pictures_says_so(tmp_path: Path) -> None:
    with LabelStore(tmp_path, write=True) as store:
        store.put(Entry("a.png", "done"), label("a.png"))
    with pytest.raises(StoreError, match="where its pictures are"):
        pack_store(tmp_path)
