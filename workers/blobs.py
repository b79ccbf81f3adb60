"""Bytes in and out by their SHA-256, in a folder, with a lifetime."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

_ID = re.compile(r"[0-9a-f]{64}")


class BlobMissing(KeyError):
    """No blob has this id: it was never put, it has expired, or the id is not one."""


class FolderBlobs:
    """Blobs as files ``root/ab/abcd…``; one lives for ``lifetime_s`` after it was last put or touched."""

    def __init__(self, root: Path, lifetime_s: float) -> None:
        self._root = root
        self._lifetime_s = lifetime_s

    def put(self, data: bytes) -> str:
        """Store ``data`` and return its id; the same bytes are stored once."""
        blob_id = hashlib.sha256(data).hexdigest()
        if not self.touch(blob_id):
            self._write(self._place(blob_id), data)
        return blob_id

    def get(self, blob_id: str) -> bytes:
        """The bytes; raises :class:`BlobMissing`."""
        try:
            return self._place(blob_id).read_bytes()
        except FileNotFoundError:
            raise BlobMissing(blob_id) from None

    def path(self, blob_id: str) -> Path:
        """The file that holds the bytes; raises :class:`BlobMissing`."""
        place = self._place(blob_id)
        if not place.is_file():
            raise BlobMissing(blob_id)
        return place

    def touch(self, blob_id: str) -> bool:
        """Start the lifetime anew; False if there is no such blob."""
        try:
            os.utime(self._place(blob_id))
        except FileNotFoundError:
            return False
        return True

    def sweep(self, now: float | None = None) -> int:
        """Remove what has outlived its lifetime at ``now`` (seconds since the epoch); return how many."""
        oldest = (time.time() if now is None else now) - self._lifetime_s
        removed = 0
        for file in self._files():
            # Another worker may sweep the same folder.
            with contextlib.suppress(FileNotFoundError):
                if file.stat().st_mtime < oldest:
                    file.unlink()
                    removed += 1
        return removed

    def _files(self) -> Iterator[Path]:
        """Blobs, and what a writer that was killed left behind."""
        return (file for file in self._root.glob("??/*") if file.is_file())

    def _place(self, blob_id: str) -> Path:
        if not _ID.fullmatch(blob_id):
            raise BlobMissing(blob_id)
        return self._root / blob_id[:2] / blob_id

    @staticmethod
    def _write(place: Path, data: bytes) -> None:
        """Write beside, then rename: a reader never sees half a blob."""
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = place.with_name(f"{place.name}.{uuid4().hex}")
        beside.write_bytes(data)
        beside.replace(place)
