"""Versions of networks: numbered, chosen, deleted; whole or not there at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.workers.networks import tiny
from workers.networks import store as store_module
from workers.networks.files import FolderFiles
from workers.networks.store import NetworkStore, NetworkUnknownError, StoreFullError


@pytest.fixture
def store(tmp_path: Path) -> NetworkStore:
    return NetworkStore(FolderFiles(tmp_path))


def add(store: NetworkStore, gain: float = 20.0, name: str = "cell7", owner: str = "a") -> int:
    data = tiny.brightness(gain)
    return store.add(tiny.card(data), data, name, owner)


def test_a_later_version_does_not_take_the_place_of_the_first_unasked(store: NetworkStore) -> None:
    assert [add(store), add(store, 10.0)] == [1, 2]
    assert store.find("cell7") == ("cell7", 1)
    assert store.onnx("cell7", 1) == tiny.brightness()
    store.use("cell7", 2)
    assert store.find("cell7") == ("cell7", 2)
    store.use("cell7", 1)
    assert store.find("cell7") == ("cell7", 1)
    assert store.find("cell7@2") == ("cell7", 2)
    assert [v.version for v in store.info("cell7").versions] == [1, 2]


def test_a_deleted_number_is_not_given_again(store: NetworkStore) -> None:
    for gain in (1.0, 2.0, 3.0):
        add(store, gain)
    assert store.delete("cell7", 3)
    assert add(store, 4.0) == 4


def test_the_version_in_service_stays_as_long_as_there_are_others(store: NetworkStore) -> None:
    add(store)
    add(store)
    assert not store.delete("cell7", 1)
    assert store.delete("cell7", 2)
    assert store.delete("cell7", 1)
    assert store.names() == []


def test_what_is_not_there_is_unknown(store: NetworkStore) -> None:
    add(store)
    for model in ("other", "cell7@2", "other@1"):
        with pytest.raises(NetworkUnknownError):
            store.find(model)
    for act in (
        lambda: store.use("cell7", 9),
        lambda: store.delete("cell7", 9),
        lambda: store.owner("other"),
    ):
        with pytest.raises(NetworkUnknownError):
            act()


def test_a_version_that_was_only_half_written_is_not_there(
    store: NetworkStore, tmp_path: Path
) -> None:
    add(store)
    (tmp_path / "cell7" / "000002.dlonet").write_bytes(b"half")
    (tmp_path / "empty").mkdir()
    assert [v.version for v in store.info("cell7").versions] == [1]
    assert store.names() == ["cell7"]
    assert add(store) == 2
    assert store.onnx("cell7", 2) == tiny.brightness()


def test_a_name_has_no_more_versions_than_may_be(
    store: NetworkStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "_MOST_VERSIONS", 2)
    add(store)
    add(store)
    with pytest.raises(StoreFullError, match="delete one first"):
        add(store)
