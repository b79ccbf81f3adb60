"""Pictures that the service was least sure of: few, each owner's own, the surest go first."""

from __future__ import annotations

from pathlib import Path

import pytest

from workers.networks.files import FolderFiles
from workers.unsure import UnsureStore


@pytest.fixture
def store(tmp_path: Path) -> UnsureStore:
    return UnsureStore(FolderFiles(tmp_path), 3)


def test_the_least_sure_ones_stay(store: UnsureStore) -> None:
    taken = [
        store.offer("a", bytes([k]), c, "why") for k, c in enumerate((0.9, 0.5, 0.7, 0.8, 0.1))
    ]
    assert taken == [True, True, True, True, True]
    assert [p.certainty for p in store.listed("a")] == [0.1, 0.5, 0.7]
    assert not store.offer("a", b"sure", 0.95, "")
    assert store.picture("a", store.listed("a")[0].id) == bytes([4])


def test_the_same_picture_is_kept_once(store: UnsureStore) -> None:
    for _ in range(3):
        store.offer("a", b"same", 0.4, "why")
    assert len(store.listed("a")) == 1


def test_owners_see_their_own(store: UnsureStore) -> None:
    store.offer("a", b"a", 0.4, "why")
    store.offer("", b"nobody's", 0.4, "why")
    assert [len(store.listed(owner)) for owner in ("a", "b", "")] == [1, 0, 1]
    with pytest.raises(FileNotFoundError):
        store.picture("b", store.listed("a")[0].id)


def test_what_is_dropped_is_gone(store: UnsureStore) -> None:
    store.offer("a", b"a", 0.4, "why")
    picture = store.listed("a")[0].id
    store.drop("a", picture)
    assert store.listed("a") == []
    with pytest.raises(FileNotFoundError):
        store.drop("a", picture)


def test_a_service_may_keep_none(tmp_path: Path) -> None:
    assert not UnsureStore(FolderFiles(tmp_path), 0).offer("a", b"a", 0.0, "why")
    assert not list(tmp_path.iterdir())
