"""Labels find their picture again: by its bytes first, then by its name, never by a guess."""

from __future__ import annotations

import hashlib
import unicodedata
from pathlib import Path

import pytest
from dlo_client.labelling import PictureLabel
from dlo_client.labelling.corrections import CorrectionReport, take_corrections
from dlo_client.labelling.formats import Imported
from dlo_client.labelling.store import corrected_file

from tests.clients.labelling import drawn, foreign

NAMES = ["a/0001.png", "b/0001.png", "cam.jpg", "cam.png", "näh/Bild 1.jpg", "frame_000012.png"]


def digest(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()


def label(name: str, sha256: str | None = None) -> PictureLabel:
    return drawn.label(name).model_copy(update={"origin": "corrected", "sha256": sha256})


def taken(
    folder: Path, *labels: PictureLabel, hashes: dict[str, str] | None = None
) -> CorrectionReport:
    known = {name: digest(name) for name in NAMES} if hashes is None else hashes
    with foreign.store_of(folder, *(drawn.label(name) for name in NAMES), sha256=known) as store:
        return take_corrections(store, Imported(labels=list(labels)))


@pytest.mark.parametrize(
    ("given", "known"),
    [
        ("images/train/a/0001.png", "a/0001.png"),
        ("C:\\data\\b\\0001.png", "b/0001.png"),
        ("a\\0001.png", "a/0001.png"),
        ("/data/cam.jpg", "cam.jpg"),
        ("./cam.png", "cam.png"),
        ("../x/cam.png", "cam.png"),
        ("CAM.JPG", "cam.jpg"),
        ("Bild 1.jpg", "näh/Bild 1.jpg"),
        (unicodedata.normalize("NFD", "näh/Bild 1.jpg"), "näh/Bild 1.jpg"),
        ("frame_000012", "frame_000012.png"),
        ("video/frame_000012", "frame_000012.png"),
    ],
)
def test_a_name_is_found_however_a_tool_writes_it(tmp_path: Path, given: str, known: str) -> None:
    """Prefixes and backslashes were "no picture of this name"."""
    report = taken(tmp_path, label(given))
    assert report.problems == {}
    assert [change.name for change in report.changes] == [known]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("0001.png", "ambiguous: a/0001.png or b/0001.png"),
        ("c/0001.png", "ambiguous: a/0001.png or b/0001.png"),
        ("cam", "ambiguous: cam.jpg or cam.png"),
        ("other.png", "no picture of this name"),
        ("", "no picture of this name"),
        ("a/", "no picture of this name"),
    ],
)
def test_a_name_that_decides_nothing_is_said(tmp_path: Path, given: str, said: str) -> None:
    assert said in taken(tmp_path, label(given)).problems[given]


def test_the_bytes_decide_between_pictures_of_one_name(tmp_path: Path) -> None:
    """The corrector page knows a file's name but not its folder: corrections landed on the other
    picture."""
    report = taken(
        tmp_path, label("0001.png", digest("b/0001.png")), label("0001.png", digest("a/0001.png"))
    )
    assert report.problems == {}
    assert [change.name for change in report.changes] == ["b/0001.png", "a/0001.png"]


def test_a_renamed_picture_is_known_by_its_bytes(tmp_path: Path) -> None:
    report = taken(tmp_path, label("renamed.png", digest("cam.png")))
    assert [change.name for change in report.changes] == ["cam.png"]


def test_bytes_that_contradict_the_name_are_refused(tmp_path: Path) -> None:
    report = taken(
        tmp_path, label("cam.jpg", digest("cam.png")), label("cam.png", digest("another picture"))
    )
    assert report.changes == []
    assert (
        report.problems["cam.jpg"]
        == "contradiction: its bytes are those of cam.png, its name is that of cam.jpg"
    )
    assert "other bytes" in report.problems["cam.png"]
    assert not corrected_file(tmp_path, "cam.jpg").exists()


def test_copies_are_told_apart_by_name_alone(tmp_path: Path) -> None:
    same = {name: digest("same") for name in NAMES}
    report = taken(
        tmp_path, label("b/0001.png", digest("same")), label("x.png", digest("same")), hashes=same
    )
    assert [change.name for change in report.changes] == ["b/0001.png"]
    assert "ambiguous" in report.problems["x.png"]


def test_labels_without_known_bytes_go_by_name(tmp_path: Path) -> None:
    """Labels of tracked strokes have no hash."""
    report = taken(tmp_path, label("cam.jpg", digest("whatever")), hashes={})
    assert [change.name for change in report.changes] == ["cam.jpg"]


def test_two_labels_of_one_picture_are_both_refused(tmp_path: Path) -> None:
    """The second one replaced the first without a word."""
    report = taken(tmp_path, label("x/cam.jpg"), label("y/cam.jpg"), label("cam.png"))
    assert [change.name for change in report.changes] == ["cam.png"]
    assert report.problems.keys() == {"x/cam.jpg", "y/cam.jpg"}
    assert "2 labels are of cam.jpg" in report.problems["x/cam.jpg"]


def test_what_nobody_confirmed_is_not_a_correction(tmp_path: Path) -> None:
    """Pictures of the corrector page that nobody touched entered the training set."""
    report = taken(tmp_path, drawn.label("cam.jpg"), label("cam.png"))
    assert [change.name for change in report.changes] == ["cam.png"]
    assert report.not_annotated == {"cam.jpg": "nobody confirmed it: its origin is service"}
    assert not corrected_file(tmp_path, "cam.jpg").exists()
