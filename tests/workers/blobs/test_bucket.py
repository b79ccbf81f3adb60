"""Blobs in a bucket do what blobs in a folder do, against real S3 servers of two makes."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.processes import wait_until
from workers.blobs import BlobMissing, Blobs, BlobsUnreachableError, FolderBlobs, bucket, open_blobs
from workers.embedded import free_port
from workers.settings import Settings

LIFETIME_S = 12_000.0


@pytest.fixture(scope="module")
def rclone(tmp_path_factory) -> Iterator[str]:
    """Address of an S3 server of another make, with a bucket ``pictures``."""
    folder, port = tmp_path_factory.mktemp("objects"), free_port()
    (folder / "pictures").mkdir()
    program = Path(sys.executable).with_name("rclone")
    command = [
        program,
        "serve",
        "s3",
        folder,
        "--addr",
        f"127.0.0.1:{port}",
        "--auth-key",
        "test,test",
    ]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as server:
        wait_until(lambda: _listens(port))
        yield f"http://127.0.0.1:{port}"
        server.kill()


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture(params=["folder", "bucket", "rclone"])
def blobs(request, tmp_path, monkeypatch) -> Iterator[Blobs]:
    if request.param == "folder":
        yield FolderBlobs(tmp_path, LIFETIME_S)
        return
    folder = "plant"
    if request.param == "bucket":
        request.getfixturevalue("s3")
    else:
        folder = tmp_path.name  # empty for each test
        names = {
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        for name, value in (
            names | {"AWS_ENDPOINT_URL_S3": request.getfixturevalue("rclone")}
        ).items():
            monkeypatch.setenv(name, value)
    yield open_blobs(Settings(blobs_url=f"s3://pictures/{folder}", blob_ttl_s=LIFETIME_S))


def test_what_was_put_comes_back_once_stored(blobs):
    first, second = blobs.put(b"picture"), blobs.put(b"picture")
    assert first == second
    assert blobs.get(first) == b"picture"
    file = blobs.path(first)
    assert file is None or file.read_bytes() == b"picture"


def test_staged_bytes_are_a_blob_once_kept(blobs):
    kept, dropped = blobs.stage(b"kept"), blobs.stage(b"dropped")
    for staged in (kept, dropped):
        with pytest.raises(BlobMissing):
            blobs.get(staged.blob_id)
    assert kept.keep() == kept.keep() == kept.blob_id
    kept.drop()
    dropped.drop()
    assert blobs.get(kept.blob_id) == b"kept"
    assert kept.bytes == 4
    with pytest.raises(BlobMissing):
        blobs.get(dropped.blob_id)


def test_dropping_does_not_remove_what_was_a_blob_before(blobs):
    blob_id = blobs.put(b"picture")
    blobs.stage(b"picture").drop()
    assert blobs.get(blob_id) == b"picture"


@pytest.mark.parametrize("blob_id", ["0" * 64, "../mark", "mark", ""])
def test_what_is_no_blob(blobs, blob_id):
    blobs.mark(make=True)
    for ask in (blobs.get, blobs.path):
        with pytest.raises(BlobMissing):
            ask(blob_id)


def test_touching(blobs):
    assert blobs.touch(blobs.put(b"picture"))
    assert not blobs.touch("0" * 64)


def test_a_picture_of_many_jobs_is_touched_once_a_minute(s3, monkeypatch):
    """Every job made the server copy its picture twice onto itself."""
    blobs = open_blobs(Settings(blobs_url="s3://pictures/plant", blob_ttl_s=LIFETIME_S))
    blob_id = blobs.put(b"picture")
    copies, now = [], time.monotonic()
    copy = blobs._client.copy_object
    monkeypatch.setattr(
        blobs._client, "copy_object", lambda **given: copies.append(given["Key"]) or copy(**given)
    )
    for _ in range(3):
        assert blobs.touch(blob_id)
    assert len(copies) == 1
    monkeypatch.setattr(bucket, "time", SimpleNamespace(time=time.time, monotonic=lambda: now + 61))
    assert blobs.touch(blob_id)
    assert len(copies) == 2


def test_what_has_outlived_its_lifetime_goes_and_what_was_staged_earlier(blobs):
    blob_id = blobs.put(b"picture")
    blobs.stage(b"left behind")
    blobs.mark(make=True)
    assert blobs.sweep(time.time()) == 0
    assert blobs.sweep(time.time() + 3700) == 1, "what was staged"
    assert blobs.get(blob_id) == b"picture"
    assert blobs.sweep(time.time() + LIFETIME_S + 120) == 1
    assert blobs.mark() is not None
    with pytest.raises(BlobMissing):
        blobs.get(blob_id)


def test_a_host_whose_clock_is_ahead_removes_nothing(blobs, monkeypatch):
    """It would have removed the pictures of everybody's waiting jobs."""
    blob_id = blobs.put(b"picture")
    ahead = time.time() + 10 * LIFETIME_S
    monkeypatch.setattr(
        bucket, "time", SimpleNamespace(time=lambda: ahead, monotonic=time.monotonic)
    )  # the server is in this process
    assert blobs.sweep() == 0
    assert blobs.get(blob_id) == b"picture"


def test_a_place_keeps_its_mark(blobs):
    assert blobs.mark() is None
    assert blobs.mark(make=True) == blobs.mark(make=True) == blobs.mark()


def test_two_folders_of_one_bucket_are_two_places(s3):
    first, second = (open_blobs(Settings(blobs_url=f"s3://pictures/{name}")) for name in ("a", "b"))
    assert first.mark(make=True) != second.mark(make=True)
    blob_id = first.put(b"picture")
    with pytest.raises(BlobMissing):
        second.get(blob_id)


def test_a_bucket_that_is_not_there_is_unreachable(s3):
    nowhere = open_blobs(Settings(blobs_url="s3://nowhere"))
    for ask in (nowhere.mark, lambda: nowhere.put(b"picture"), nowhere.sweep):
        with pytest.raises(BlobsUnreachableError):
            ask()


def test_a_server_that_is_not_there_is_unreachable(s3, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", "http://127.0.0.1:1")
    with pytest.raises(BlobsUnreachableError):
        open_blobs(Settings(blobs_url="s3://pictures")).put(b"picture")


def test_without_what_a_bucket_needs_the_message_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "boto3", None)
    monkeypatch.delitem(sys.modules, "workers.blobs.bucket")
    with pytest.raises(ModuleNotFoundError, match=r"requirements/s3\.txt"):
        open_blobs(Settings(blobs_url="s3://pictures"))
