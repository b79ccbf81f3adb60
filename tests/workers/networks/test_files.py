"""Files without a lifetime: in a folder and in a bucket they are the same, and no sweep of the
blobs takes them."""

from __future__ import annotations

import threading
import time

import pytest

from workers.blobs import open_blobs
from workers.networks.files import Files, open_files
from workers.settings import Settings


@pytest.fixture(params=["folder", "bucket"])
def settings(request, tmp_path) -> Settings:
    if request.param == "folder":
        return Settings(data_dir=tmp_path)
    request.getfixturevalue("s3")
    return Settings(data_dir=tmp_path, blobs_url="s3://pictures/plant")


@pytest.fixture
def files(settings) -> Files:
    return open_files(settings, "networks")


def test_files_come_back_by_folder_and_name(files: Files) -> None:
    assert files.folders() == []
    for folder, name in (("a", "2"), ("a", "1"), ("b", "1")):
        files.write(folder, name, f"{folder}{name}".encode())
    files.write("a", "1", b"anew")
    assert (files.folders(), files.names("a"), files.names("c")) == (["a", "b"], ["1", "2"], [])
    assert files.read("a", "1") == b"anew"
    files.remove("a", "1")
    files.remove("a", "1")
    with pytest.raises(FileNotFoundError):
        files.read("a", "1")
    files.remove("a")
    assert files.folders() == ["b"]


def test_the_sweep_of_the_blobs_leaves_them(settings: Settings, files: Files) -> None:
    """A network would have been gone after the lifetime of a picture."""
    files.write("a", "1", b"network")
    open_blobs(settings).sweep(time.time() + 10 * settings.blob_ttl_s)
    assert files.read("a", "1") == b"network"


def test_two_sorts_do_not_meet(settings: Settings, files: Files) -> None:
    files.write("a", "1", b"network")
    assert open_files(settings, "unsure").folders() == []


def test_one_at_a_time_holds_a_folder(files: Files) -> None:
    order: list[str] = []

    def second() -> None:
        with files.locked("a"):
            order.append("second")

    with files.locked("a"):
        thread = threading.Thread(target=second)
        thread.start()
        time.sleep(0.3)
        order.append("first")
    thread.join(20)
    assert order == ["first", "second"]
