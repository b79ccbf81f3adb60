"""Which files of a folder, an archive or a list are pictures, and what is said of the others."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from dlo_client.labelling.sources import SourceError, find_pictures


def files(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"picture")
    return folder


def test_other_files_are_counted_by_suffix(tmp_path):
    """HEIC pictures were passed over without a word, and JFIF is JPEG."""
    found = find_pictures(
        files(tmp_path, "a.jpg", "b.JFIF", "c.gif", "d.heic", "e.HEIC", "notes.txt", ".hidden.cfg")
    )
    assert [picture.name for picture in found] == ["a.jpg", "b.JFIF", "c.gif"]
    assert found.skipped == {".heic": 2, ".txt": 1}


def test_what_a_mac_adds_to_archives_is_no_picture(tmp_path):
    """``__MACOSX/shoot/._cam.jpg`` was counted as a picture that failed."""
    with zipfile.ZipFile(tmp_path / "mac.zip", "w") as archive:
        for name in ("shoot/cam.jpg", "__MACOSX/shoot/._cam.jpg", "shoot/.DS_Store"):
            archive.writestr(name, b"picture")
    found = find_pictures(tmp_path / "mac.zip")
    assert [picture.name for picture in found] == ["shoot/cam.jpg"]
    assert found.skipped == {}


def test_a_list_may_begin_with_a_byte_order_mark(tmp_path):
    """Its first path was reported missing: the mark was read as a part of it."""
    files(tmp_path, "pics/cam.jpg")
    (tmp_path / "list.txt").write_bytes(b"\xef\xbb\xbfpics/cam.jpg\r\n")
    (picture,) = find_pictures(tmp_path / "list.txt")
    assert (picture.name, picture.read()) == ("pics/cam.jpg", b"picture")


def test_a_folder_without_pictures_names_what_is_there(tmp_path):
    with pytest.raises(SourceError, match=r"2 \.heic"):
        find_pictures(files(tmp_path, "a.heic", "b.heic"))
