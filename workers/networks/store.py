"""The networks of this service's users: every name has versions, one of which the name stands for.

Strategy: a version is two files, the network's own and what is known of it; the second is written
last, so a version is there as a whole or not at all. Which version a name stands for is one small
file. Only the first version of a name takes that place by itself, as nobody can have used the name
before: later ones wait until somebody asks for them.
"""

from __future__ import annotations

from datetime import UTC, datetime

from dlo_client.contracts import NetworkInfo
from dlo_client.contracts.base import Contract
from dlo_client.contracts.networks import NetworkCard, NetworkVersion
from pydantic import ValidationError

from workers.networks.files import Files, open_files
from workers.networks.package import SUFFIX, pack, unpack
from workers.settings import Settings

_STATE = "state.json"
_MOST_VERSIONS = 50
"""Of a name; one has to be deleted before another is stored."""
_INPUT = "(1, 3, H, W) float32 RGB, normalized; H and W multiples of {multiple}; output logits (1, 1, H, W)"


class NetworkUnknownError(KeyError):
    """No network, or no version of it, is stored under this name."""


class StoreFullError(Exception):
    """There are as many versions of a network as may be."""


class _State(Contract):
    """``current``: the version that the name stands for; ``latest``: the highest number that was
    ever given."""

    owner: str
    current: int
    latest: int


class _Kept(Contract):
    """What is known of a version."""

    card: NetworkCard
    bytes: int
    stored_at: datetime


class NetworkStore:
    """Many processes may use one place at the same time."""

    def __init__(self, files: Files) -> None:
        self._files = files

    @classmethod
    def of(cls, settings: Settings) -> NetworkStore:
        """The one of a service and its workers."""
        return cls(open_files(settings, "networks"))

    def names(self) -> list[str]:
        return [name for name in self._files.folders() if self._state(name) is not None]

    def owner(self, name: str) -> str:
        """Who stored the first version. Raises NetworkUnknownError."""
        return self._known(name).owner

    def find(self, model: str) -> tuple[str, int]:
        """Name and version that ``name`` or ``name@version`` stands for. Raises
        NetworkUnknownError."""
        name, _, wanted = model.partition("@")
        version = int(wanted) if wanted.isdecimal() else self._known(name).current
        if version not in self._versions(name):
            raise NetworkUnknownError(model)
        return name, version

    def card(self, name: str, version: int) -> NetworkCard:
        """Raises NetworkUnknownError."""
        return self._kept(name, version).card

    def file(self, name: str, version: int) -> bytes:
        """The network's file. Raises NetworkUnknownError."""
        try:
            return self._files.read(name, _file(version))
        except FileNotFoundError:
            raise NetworkUnknownError(f"{name}@{version}") from None

    def onnx(self, name: str, version: int) -> bytes:
        """Its weights. Raises NetworkUnknownError, and PackageError for a file that was damaged."""
        data = self.file(name, version)
        return unpack(data, len(data))[1]

    def info(self, name: str) -> NetworkInfo:
        """What is known of a network, and of all its versions. Raises NetworkUnknownError."""
        state = self._known(name)
        kept = {version: self._kept(name, version) for version in self._versions(name)}
        current = kept[state.current]
        card = current.card
        return NetworkInfo(
            name=name,
            version=str(state.current),
            task=card.task,
            default=False,
            warm=False,
            sha256=card.sha256,
            bytes=current.bytes,
            parameters=card.parameters,
            input=_INPUT.format(multiple=card.preprocess.multiple),
            origin=card.origin,
            license=card.license,
            metrics=card.metrics,
            shipped=False,
            owner=state.owner,
            parent=card.parent,
            versions=[_version(number, one) for number, one in kept.items()],
        )

    def add(self, card: NetworkCard, onnx: bytes, name: str, owner: str) -> int:
        """Store a further version of ``name``; its number. Raises StoreFullError, OSError."""
        with self._files.locked(name):
            state = self._state(name)
            if len(self._versions(name)) >= _MOST_VERSIONS:
                raise StoreFullError(f"{name} has {_MOST_VERSIONS} versions; delete one first")
            version = 1 + (state.latest if state else 0)
            card = card.model_copy(update={"name": name})
            data = pack(card, onnx)
            self._files.write(name, _file(version), data)
            kept = _Kept(card=card, bytes=len(onnx), stored_at=datetime.now(UTC))
            self._files.write(name, _about(version), kept.model_dump_json().encode())
            updated = state.model_copy(update={"latest": version}) if state else None
            self._write(name, updated or _State(owner=owner, current=version, latest=version))
        return version

    def use(self, name: str, version: int) -> None:
        """Let ``name`` stand for ``version``. Raises NetworkUnknownError."""
        with self._files.locked(name):
            state = self._known(name)
            if version not in self._versions(name):
                raise NetworkUnknownError(f"{name}@{version}")
            self._write(name, state.model_copy(update={"current": version}))

    def delete(self, name: str, version: int | None = None) -> bool:
        """A version, or all of them; False for the version that the name stands for while there are
        others.

        Raises NetworkUnknownError.
        """
        with self._files.locked(name):
            state, versions = self._known(name), self._versions(name)
            if version is not None and version not in versions:
                raise NetworkUnknownError(f"{name}@{version}")
            if version is None or versions == [version]:
                self._files.remove(name, _STATE)  # first: what is not whole is not there
                self._files.remove(name)
                return True
            if version == state.current:
                return False
            self._files.remove(name, _about(version))
            self._files.remove(name, _file(version))
            return True

    def _versions(self, name: str) -> list[int]:
        stems = (
            file.removesuffix(".json") for file in self._files.names(name) if file.endswith(".json")
        )
        return sorted(int(stem) for stem in stems if stem.isdecimal())

    def _known(self, name: str) -> _State:
        state = self._state(name)
        if state is None:
            raise NetworkUnknownError(name)
        return state

    def _state(self, name: str) -> _State | None:
        try:
            return _State.model_validate_json(self._files.read(name, _STATE))
        except (FileNotFoundError, NotADirectoryError, ValidationError):
            return None

    def _write(self, name: str, state: _State) -> None:
        self._files.write(name, _STATE, state.model_dump_json().encode())

    def _kept(self, name: str, version: int) -> _Kept:
        try:
            return _Kept.model_validate_json(self._files.read(name, _about(version)))
        except (FileNotFoundError, ValidationError):
            raise NetworkUnknownError(f"{name}@{version}") from None


def _version(number: int, kept: _Kept) -> NetworkVersion:
    return NetworkVersion(
        version=number,
        sha256=kept.card.sha256,
        created_at=kept.stored_at,
        parent=kept.card.parent,
        origin=kept.card.origin,
        metrics=kept.card.metrics,
    )


def _file(version: int) -> str:
    return f"{version:06d}{SUFFIX}"


def _about(version: int) -> str:
    return f"{version:06d}.json"
