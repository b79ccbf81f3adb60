import hashlib
import os
import time
from pathlib import Path

import pytest

from workers.blobs import BlobMissing, FolderBlobs, NoRoomError

HOUR = 3600.0


@pytest.fixture
def blobs(tmp_path):
    return FolderBlobs(tmp_path / "blobs", HOUR)


def test_bytes_come_back_under_their_sha256(blobs):
    blob_id = blobs.put(b"cable")
    assert blob_id == hashlib.sha256(b"cable").hexdigest()
    assert blobs.get(blob_id) == b"cable"
    assert blobs.path(blob_id).read_bytes() == b"cable"


def test_the_same_bytes_are_one_file_and_nothing_else_is_left(blobs, tmp_path):
    assert blobs.put(b"cable") == blobs.put(b"cable")
    assert len([path for path in tmp_path.rglob("*") if path.is_file()]) == 1


@pytest.mark.parametrize(
    "name", ["0" * 64, "", "../secret", "a/../../secret", "A" * 64, "0" * 64 + "\n"]
)
def test_what_is_no_blob_is_missing(blobs, tmp_path, name):
    (tmp_path / "secret").write_text("x")
    for look in (blobs.get, blobs.path, blobs.touch):
        if look == blobs.touch and name == "0" * 64:
            assert look(name) is False
        else:
            with pytest.raises(BlobMissing):
                look(name)


def test_sweep_removes_what_was_not_touched_for_its_lifetime(blobs):
    old, touched, new = (blobs.put(data) for data in (b"old", b"touched", b"new"))
    for blob_id in (old, touched):
        os.utime(blobs.path(blob_id), (0, time.time() - HOUR - 1))
    assert blobs.touch(touched)
    assert blobs.sweep() == 1
    assert blobs.get(touched) == b"touched"
    assert blobs.get(new) == b"new"
    with pytest.raises(BlobMissing):
        blobs.get(old)


def test_putting_again_starts_the_lifetime_anew(blobs):
    blob_id = blobs.put(b"cable")
    os.utime(blobs.path(blob_id), (0, time.time() - HOUR - 1))
    blobs.put(b"cable")
    assert blobs.sweep() == 0


def test_sweep_of_a_folder_that_is_not_there_yet(blobs):
    assert blobs.sweep() == 0


def test_what_is_staged_is_a_blob_only_once_it_is_kept(blobs):
    dropped, kept = blobs.stage(b"dropped"), blobs.stage(b"kept")
    for staged in (dropped, kept):
        with pytest.raises(BlobMissing):
            blobs.get(staged.blob_id)
    dropped.drop()
    assert kept.keep() == kept.keep() == kept.blob_id
    kept.drop()
    assert blobs.get(kept.blob_id) == b"kept"
    assert len(list(blobs._files())) == 1


def test_dropping_bytes_that_were_a_blob_before_leaves_the_blob(blobs):
    blob_id = blobs.put(b"cable")
    blobs.stage(b"cable").drop()
    assert blobs.get(blob_id) == b"cable"


def test_sweep_removes_what_a_killed_process_had_staged(blobs):
    staged = blobs.stage(b"half")
    assert blobs.sweep(time.time() + HOUR / 2) == 0
    assert blobs.sweep(time.time() + HOUR + 1) == 1
    assert not staged._beside.exists()


def test_a_blob_that_a_crash_left_empty_is_written_again(blobs):
    blob_id = blobs.put(b"cable")
    blobs.path(blob_id).write_bytes(b"")
    blobs.put(b"cable")
    assert blobs.get(blob_id) == b"cable"


def test_the_reserve_stays_free(tmp_path):
    free = FolderBlobs(tmp_path, HOUR).free_bytes()
    with pytest.raises(NoRoomError):
        FolderBlobs(tmp_path, HOUR, reserve_bytes=free * 2).put(b"cable")
    assert list(tmp_path.iterdir()) == []


def test_nobody_else_on_the_machine_reads_them(blobs, tmp_path):
    blobs.put(b"cable")
    assert oct((tmp_path / "blobs").stat().st_mode)[-3:] == "700"


def test_what_is_kept_is_on_the_disk_before_it_is_a_blob(blobs, tmp_path, monkeypatch):
    """After a loss of power the queue knew jobs whose pictures were files without bytes."""
    synced = []

    def fsync(handle: int) -> None:
        path = Path(f"/proc/self/fd/{handle}").readlink()
        synced.append((path.relative_to(tmp_path / "blobs"), path.is_dir() or path.read_bytes()))

    monkeypatch.setattr(os, "fsync", fsync)
    staged = blobs.stage(b"cable")
    place = Path(staged.blob_id[:2])
    (root, _), (beside, content) = synced
    assert (root, beside.parent, content) == (Path(), place, b"cable")
    staged.keep()
    assert synced[2:] == [(place, True)]
    del synced[:]
    blobs.put(b"cable")
    assert synced == [], "it was a blob before"
