"""Which folder of pictures counts, and who is kept out."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from redis import Redis

from workers import presence, shared_folder
from workers.connection import connect


@pytest.fixture
def queue_server(settings):
    with connect(settings) as client:
        yield client


def announce(client: Redis) -> None:
    presence.announce(client, presence.WorkerInfo("w", True, False, [], datetime.now(UTC), []))


def test_a_folder_keeps_its_mark(tmp_path):
    mark = shared_folder.mark_of(tmp_path / "blobs")
    assert mark == shared_folder.mark_of(tmp_path / "blobs")
    assert mark != shared_folder.mark_of(tmp_path / "others")
    assert [path.name for path in (tmp_path / "blobs").iterdir()] == ["mark"]


def test_before_anybody_has_claimed_nobody_is_apart(queue_server, tmp_path):
    assert shared_folder.apart(queue_server, tmp_path / "any") is None


def test_the_folder_of_the_service_counts(queue_server, tmp_path):
    shared_folder.claim(queue_server, tmp_path / "service")
    assert shared_folder.apart(queue_server, tmp_path / "service") is None
    for other in (tmp_path / "other", tmp_path / "not there" / "at all"):
        assert "give all of them one DLO_DATA_DIR" in (shared_folder.apart(queue_server, other) or "")
    shared_folder.mark_of(tmp_path / "other")
    assert str(tmp_path / "other") in (shared_folder.apart(queue_server, tmp_path / "other") or "")


def test_a_service_beside_ready_workers_does_not_take_over(queue_server, tmp_path, monkeypatch):
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    shared_folder.claim(queue_server, tmp_path / "first")
    announce(queue_server)
    shared_folder.claim(queue_server, tmp_path / "second")
    assert shared_folder.apart(queue_server, tmp_path / "first") is None
    assert shared_folder.apart(queue_server, tmp_path / "second") is not None


def test_a_folder_that_was_emptied_counts_again(queue_server, tmp_path):
    shared_folder.claim(queue_server, tmp_path)
    (tmp_path / "mark").unlink()
    assert shared_folder.apart(queue_server, tmp_path) is not None
    shared_folder.claim(queue_server, tmp_path)
    assert shared_folder.apart(queue_server, tmp_path) is None
