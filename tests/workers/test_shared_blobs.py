"""Which place of pictures counts, and who is kept out."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from redis import Redis

from tests.processes import KEYS
from workers import presence, shared_blobs
from workers.blobs import Blobs, BlobsUnreachableError, FolderBlobs
from workers.connection import connect


@pytest.fixture
def queue_server(settings):
    with connect(settings) as client:
        yield client


def blobs(folder) -> Blobs:
    return FolderBlobs(folder, 60)


def announce(client: Redis) -> None:
    presence.announce(
        client, KEYS, presence.WorkerInfo("w", True, False, [], datetime.now(UTC), [])
    )


def test_a_folder_keeps_its_mark(tmp_path):
    mark = blobs(tmp_path / "blobs").mark(make=True)
    assert mark == blobs(tmp_path / "blobs").mark(make=True)
    assert mark != blobs(tmp_path / "others").mark(make=True)
    assert [path.name for path in (tmp_path / "blobs").iterdir()] == ["mark"]


def test_before_anybody_has_claimed_nobody_is_apart(queue_server, tmp_path):
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path / "any")) is None


def test_the_folder_of_the_service_counts(queue_server, tmp_path):
    shared_blobs.claim(queue_server, KEYS, blobs(tmp_path / "service"))
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path / "service")) is None
    for other in (tmp_path / "other", tmp_path / "not there" / "at all"):
        assert "give all of them one DLO_DATA_DIR" in (
            shared_blobs.apart(queue_server, KEYS, blobs(other)) or ""
        )
    blobs(tmp_path / "other").mark(make=True)
    assert str(tmp_path / "other") in (
        shared_blobs.apart(queue_server, KEYS, blobs(tmp_path / "other")) or ""
    )


def test_a_service_beside_ready_workers_does_not_take_over(queue_server, tmp_path, monkeypatch):
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    shared_blobs.claim(queue_server, KEYS, blobs(tmp_path / "first"))
    announce(queue_server)
    shared_blobs.claim(queue_server, KEYS, blobs(tmp_path / "second"))
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path / "first")) is None
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path / "second")) is not None


def test_a_folder_that_was_emptied_counts_again(queue_server, tmp_path):
    shared_blobs.claim(queue_server, KEYS, blobs(tmp_path))
    (tmp_path / "mark").unlink()
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path)) is not None
    shared_blobs.claim(queue_server, KEYS, blobs(tmp_path))
    assert shared_blobs.apart(queue_server, KEYS, blobs(tmp_path)) is None


class Away:
    """A place that does not answer."""

    place = "the bucket s3://pictures/"

    def mark(self, *, make: bool = False) -> str | None:
        raise BlobsUnreachableError("access denied")


def test_a_worker_whose_place_does_not_answer_does_not_join_and_says_why(
    queue_server, tmp_path, monkeypatch
):
    def give_up(_: float) -> None:
        raise TimeoutError

    monkeypatch.setattr(shared_blobs.time, "sleep", give_up)
    for _ in range(2):  # before and after a service has claimed its own place
        with pytest.raises(TimeoutError):
            shared_blobs.join(queue_server, KEYS, Away(), "w")
        assert queue_server.get(KEYS.outsider) == (
            "worker w does not join: the bucket s3://pictures/ cannot be used: access denied"
        )
        shared_blobs.claim(queue_server, KEYS, blobs(tmp_path))
