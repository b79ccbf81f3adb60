"""Corrected labels as a training source: the form that the service's own training reads and
mixes."""

from __future__ import annotations

import errno
import io
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling import LabelStore, find_pictures
from dlo_client.labelling import training_set as training_sets
from dlo_client.labelling.store import Entry, corrected_file, write_whole
from dlo_client.labelling.training_set import INDEX, export_training_set
from PIL import Image

from models.synthesis.datasets import load, read_index, samples_in
from tests.clients.labelling import drawn

NAMES = ["plain.png", "shelf 2/näh bild.jpg", "shelf 2/plain.png"]


def picture(name: str, size: tuple[int, int] = (drawn.WIDTH, drawn.HEIGHT)) -> bytes:
    """Of one color, another one for each name."""
    buffer = io.BytesIO()
    Image.new("RGB", size, (NAMES.index(name) * 100, 50, 25)).save(buffer, "PNG")
    return buffer.getvalue()


@pytest.fixture
def source(tmp_path: Path) -> Path:
    for name in NAMES:
        write_whole(tmp_path / "in" / name, picture(name))
    return tmp_path / "in"


@pytest.fixture
def store(tmp_path: Path):
    """All pictures labelled, all but the first corrected: the ring is gone."""
    with LabelStore(tmp_path / "out", write=True) as opened:
        for name in NAMES:
            label = drawn.label(name)
            opened.put(Entry(name, "done"), label)
            better = label.model_copy(
                update={"instances": label.instances[:2], "origin": "corrected"}
            )
            if name != NAMES[0]:
                write_whole(corrected_file(opened.folder, name), better.model_dump_json().encode())
        opened.put(Entry("broken.png", "failed", detail="cannot be read"))
        yield opened


def names_in(folder: Path) -> list[str]:
    return [record["source"] for record in read_index(folder)]


def test_what_was_corrected_is_what_training_reads(
    store: LabelStore, source: Path, tmp_path: Path
) -> None:
    assert export_training_set(store, find_pictures(source), tmp_path / "set") == {}
    assert names_in(tmp_path / "set") == NAMES[1:]
    samples = samples_in(tmp_path / "set")
    assert len(samples) == 2
    upper, lower, _ = (drawn.mask(i) for i in drawn.label().instances)
    for sample in samples:
        image, mask = load(sample)
        assert np.array_equal(mask, upper | lower), "the corrected label, not the service's"
        assert image.shape == (drawn.HEIGHT, drawn.WIDTH, 3)
    assert {tuple(load(sample)[0][0, 0]) for sample in samples} == {(100, 50, 25), (200, 50, 25)}
    ids = np.asarray(Image.open(samples[0].truth))
    assert np.array_equal(ids == 2, lower)


def test_nothing_is_left_to_learn_from_in_an_ignored_area(source: Path, tmp_path: Path) -> None:
    """Half of the picture is white and ignored: it becomes as gray as the picture's mean, and no
    cable."""
    image = Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT))
    image.paste((255, 255, 255), (0, 0, drawn.WIDTH // 2, drawn.HEIGHT))
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    write_whole(tmp_path / "in" / NAMES[0], buffer.getvalue())
    half = [
        (-1, -1),
        (drawn.WIDTH // 2 - 1, -1),
        (drawn.WIDTH // 2 - 1, drawn.HEIGHT),
        (-1, drawn.HEIGHT),
    ]
    with LabelStore(tmp_path / "out", write=True) as store:
        label = drawn.label(NAMES[0]).model_copy(
            update={"instances": [], "crossings": [], "ignore": [half]}
        )
        store.put(Entry(NAMES[0], "done"), label)
        assert (
            export_training_set(
                store, find_pictures(source), tmp_path / "set", corrected_only=False
            )
            == {}
        )
    (sample,) = samples_in(tmp_path / "set")
    pixels, mask = load(sample)
    assert not mask.any()
    assert abs(int(pixels[5, 5, 0]) - 127) < 3
    assert pixels[5, -5].tolist() == [0, 0, 0]


def test_labels_that_nobody_corrected_come_only_when_asked_for(
    store: LabelStore, source: Path, tmp_path: Path
) -> None:
    export_training_set(store, find_pictures(source), tmp_path / "set", corrected_only=False)
    assert names_in(tmp_path / "set") == NAMES
    assert [record["origin"] for record in read_index(tmp_path / "set")] == [
        "service",
        "corrected",
        "corrected",
    ]


def test_an_export_that_was_cut_off_goes_on(
    store: LabelStore, source: Path, tmp_path: Path
) -> None:
    """Killed in the middle of a line of the index."""
    export_training_set(store, find_pictures(source), tmp_path / "set")
    index = tmp_path / "set" / INDEX
    whole = index.read_bytes()
    index.write_bytes(whole[:-10])
    first = next((tmp_path / "set").glob("shelf 2__näh*_ids.png"))
    before = first.stat().st_mtime_ns
    assert export_training_set(store, find_pictures(source), tmp_path / "set") == {}
    assert index.read_bytes() == whole
    assert first.stat().st_mtime_ns == before, "what is there is left alone"


def test_pictures_that_are_gone_broken_or_of_another_size_are_named(
    store: LabelStore, source: Path, tmp_path: Path
) -> None:
    (source / NAMES[0]).write_bytes(picture(NAMES[0], (20, 10)))
    (source / NAMES[1]).write_bytes(b"no picture")
    pictures = [p for p in find_pictures(source) if p.name != NAMES[2]]
    problems = export_training_set(store, pictures, tmp_path / "set", corrected_only=False)
    assert problems.keys() == set(NAMES)
    assert "20×10 now" in problems[NAMES[0]]
    assert "decoded" in problems[NAMES[1]]
    assert "no longer in the source" in problems[NAMES[2]]
    assert names_in(tmp_path / "set") == []


def test_a_damaged_correction_costs_no_other(
    store: LabelStore, source: Path, tmp_path: Path
) -> None:
    corrected_file(store.folder, NAMES[1]).write_text("{")
    problems = export_training_set(store, find_pictures(source), tmp_path / "set")
    assert problems.keys() == {NAMES[1]}
    assert names_in(tmp_path / "set") == [NAMES[2]]


def test_a_full_folder_costs_only_what_did_not_fit(
    store: LabelStore, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(file: Path, content: bytes) -> None:
        if "näh" in file.name and not file.stem.endswith("_ids"):
            raise OSError(errno.ENOSPC, "No space left on device")
        write_whole(file, content)

    monkeypatch.setattr(training_sets, "write_whole", full)
    problems = export_training_set(store, find_pictures(source), tmp_path / "set")
    assert problems == {NAMES[1]: "cannot be written: No space left on device"}
    assert [sample.name for sample in samples_in(tmp_path / "set")] == ["shelf 2__plain_png"], (
        "half a sample is none"
    )
