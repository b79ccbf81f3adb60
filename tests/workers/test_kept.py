"""Documents that stay: versions, and the pictures that go with them."""

from __future__ import annotations

import os
import threading
import time

import pytest

from workers.blobs import FolderBlobs
from workers.kept import FullError, Shelf, kept_pictures, sweep


@pytest.fixture
def shelf(job_queue) -> Shelf:
    return job_queue.recipes


def test_versions_count_up_and_stay(shelf):
    assert [shelf.put("7", text) for text in ("a", "b", "c")] == [1, 2, 3]
    assert shelf.get("7").text == "c"
    assert shelf.get("7", 1).text == "a"
    assert [kept.version for kept in shelf.history("7")] == [3, 2, 1]
    assert shelf.get("7", 4) is shelf.get("8") is None


def test_only_the_last_hundred_versions_are_kept(shelf):
    for number in range(103):
        shelf.put("7", str(number), [f"{number:064d}"])
    assert shelf.get("7", 3) is None
    assert shelf.get("7", 4).text == "3"
    assert len(shelf.pictures()) == 100


def test_replicas_never_give_the_same_number(shelf):
    given = []
    threads = [threading.Thread(target=lambda: given.append(shelf.put("7", "x"))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(given) == list(range(1, 9))


def test_sorts_do_not_mix(job_queue):
    job_queue.recipes.put("a", "recipe")
    job_queue.cameras.put("a", "camera")
    assert job_queue.recipes.get("a").text == "recipe"
    assert job_queue.recipes.delete("a")
    assert not job_queue.recipes.delete("a")
    assert [kept.text for kept in job_queue.cameras.latest()] == ["camera"]


def test_there_is_a_limit(shelf, monkeypatch):
    monkeypatch.setattr("workers.kept._MOST_NAMES", 2)
    shelf.put("1", "x")
    shelf.put("2", "x")
    shelf.put("1", "y")
    with pytest.raises(FullError):
        shelf.put("3", "x")


def test_the_sweep_leaves_the_pictures_of_recipes(settings, job_queue):
    """A recipe's stored samples would be gone a day later."""
    blobs = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s)
    kept, other = blobs.put(b"sample"), blobs.put(b"anything")
    job_queue.recipes.put("7", "{}", [kept])
    assert kept_pictures(job_queue._client, settings.keys) == {kept}
    old = time.time() - 2 * settings.blob_ttl_s
    for blob in (kept, other):
        os.utime(blobs.path(blob), (old, old))
    assert sweep(blobs, job_queue._client, settings.keys) == 1
    assert blobs.get(kept) == b"sample"
