"""Files by key, for what has no lifetime: the little that a store of networks asks of whatever
keeps it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol
from uuid import uuid4

from workers.settings import Settings


class Files(Protocol):
    """Keys are ``folder/name``. A reader never sees half a file."""

    def folders(self) -> list[str]:
        """By name."""

    def names(self, folder: str) -> list[str]:
        """Of the files in a folder, by name; none of one that is not there."""

    def read(self, folder: str, name: str) -> bytes:
        """Raises FileNotFoundError."""

    def write(self, folder: str, name: str, data: bytes) -> None:
        """Raises OSError when the disk takes nothing more."""

    def remove(self, folder: str, name: str | None = None) -> None:
        """A file, or the folder with all that is in it; one that is not there is removed
        already."""

    def locked(self, folder: str) -> contextlib.AbstractContextManager[None]:
        """Others that ask for it wait."""


def open_files(settings: Settings, sort: str) -> Files:
    """Where the blobs are: in the bucket, or in the folder ``sort`` of the data folder."""
    if settings.blobs_url:
        from workers.blobs.bucket_files import BucketFiles

        return BucketFiles(settings.blobs_url, sort)
    return FolderFiles(settings.data_dir / sort)


class FolderFiles:
    """:class:`Files` below ``root``, readable for its owner alone."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def folders(self) -> list[str]:
        return sorted(p.name for p in self._root.glob("*") if p.is_dir())

    def names(self, folder: str) -> list[str]:
        return sorted(p.name for p in (self._root / folder).glob("*") if not p.name.startswith("."))

    def read(self, folder: str, name: str) -> bytes:
        return (self._root / folder / name).read_bytes()

    def write(self, folder: str, name: str, data: bytes) -> None:
        place = self._root / folder
        place.mkdir(parents=True, exist_ok=True, mode=0o700)
        beside = place / f".{name}.{uuid4().hex}"
        try:
            beside.write_bytes(data)
            beside.replace(place / name)
        finally:
            beside.unlink(missing_ok=True)

    def remove(self, folder: str, name: str | None = None) -> None:
        if name is None:
            shutil.rmtree(self._root / folder, ignore_errors=True)
        else:
            (self._root / folder / name).unlink(missing_ok=True)

    @contextmanager
    def locked(self, folder: str) -> Iterator[None]:
        self._root.mkdir(parents=True, exist_ok=True, mode=0o700)
        handle = os.open(self._root / f".{folder}.lock", os.O_CREAT | os.O_RDWR, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)
