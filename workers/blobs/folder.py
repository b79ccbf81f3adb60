"""Blobs as files in a folder.

Strategy: bytes are written beside their place and renamed, so that a reader never sees half a blob;
what a write that failed has left is removed at once. Who stages bytes decides later whether to keep
them. A blob that is kept is on the disk, not only in the memory of the machine: the queue remembers
its job over a loss of power. Nothing is written that would leave less of the disk free than a
reserve: others on the same disk have to go on.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from workers.blobs.contract import BlobMissing, NoRoomError, Staged

_ID = re.compile(r"[0-9a-f]{64}")
_DISK_IS_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_MARK = "mark"
_STAGED_FOR_S = 3600.0
"""What is still staged after so long was left by a process that was killed."""


@dataclass(frozen=True)
class StagedFile:
    """Bytes on the disk that are no blob yet, unless they were one before."""

    blob_id: str
    bytes: int
    _place: Path
    _beside: Path | None

    @property
    def is_new(self) -> bool:
        """Whether no blob had these bytes before."""
        return self._beside is not None

    def keep(self) -> str:
        """Make a blob of them; its id."""
        if self._beside is None:
            os.utime(self._place)
        else:
            with contextlib.suppress(FileNotFoundError):  # kept before
                self._beside.replace(self._place)
                _sync(self._place.parent)
        return self.blob_id

    def drop(self) -> None:
        """Forget them; nothing happens to a blob."""
        if self._beside is not None:
            self._beside.unlink(missing_ok=True)


class FolderBlobs:
    """Blobs as files ``root/ab/abcd…``; one lives for ``lifetime_s`` after it was last put or
    touched."""

    def __init__(self, root: Path, lifetime_s: float, reserve_bytes: int = 0) -> None:
        self._root = root
        self.place = f"the folder {root}"
        self._lifetime_s = lifetime_s
        self._reserve_bytes = reserve_bytes

    def put(self, data: bytes) -> str:
        """Store ``data`` and return its id; the same bytes are stored once. Raises
        :class:`NoRoomError`."""
        return self.stage(data).keep()

    def stage(self, data: bytes) -> StagedFile:
        """Write ``data`` to the disk, to be kept or dropped; raises :class:`NoRoomError`."""
        blob_id = hashlib.sha256(data).hexdigest()
        place = self._place(blob_id)
        known = self.touch(blob_id) and place.stat().st_size == len(
            data
        )  # a crash may leave an empty file
        return StagedFile(
            blob_id, len(data), place, None if known else self._write_beside(place, data)
        )

    def free_bytes(self) -> int:
        """What may still be written."""
        folder = next(
            folder for folder in (self._root, *self._root.absolute().parents) if folder.exists()
        )
        return shutil.disk_usage(folder).free - self._reserve_bytes

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

    def let_go(self, staged: Staged, after_s: float) -> None:
        """See :class:`workers.blobs.Blobs`."""
        if staged.is_new:
            with contextlib.suppress(FileNotFoundError):
                at = self._clock() - self._lifetime_s + after_s
                os.utime(self._place(staged.blob_id), (at, at))

    def sweep(self, now: float | None = None) -> int:
        """Remove what has outlived its lifetime at ``now`` (seconds since the epoch); return how
        many."""
        if not self._root.is_dir():
            return 0
        now = self._clock() if now is None else now
        removed = 0
        for file in self._files():
            lifetime_s = (
                self._lifetime_s
                if _ID.fullmatch(file.name)
                else min(_STAGED_FOR_S, self._lifetime_s)
            )
            # Another worker may sweep the same folder.
            with contextlib.suppress(FileNotFoundError):
                if file.stat().st_mtime < now - lifetime_s:
                    file.unlink()
                    removed += 1
        return removed

    def _clock(self) -> float:
        """What the file system takes for now: a host whose clock is ahead would remove what others
        need."""
        os.utime(self._root)
        return self._root.stat().st_mtime

    def mark(self, *, make: bool = False) -> str | None:
        """See :class:`workers.blobs.Blobs`."""
        file = self._root / _MARK
        with contextlib.suppress(OSError):
            return file.read_text()
        if not make:
            return None
        self._root.mkdir(parents=True, exist_ok=True, mode=0o700)
        beside = self._root / f"{_MARK}.{uuid4().hex}"
        beside.write_text(uuid4().hex)
        with contextlib.suppress(FileExistsError):
            os.link(beside, file)  # whole at once: nobody reads half a mark
        beside.unlink()
        return file.read_text()

    def _files(self) -> Iterator[Path]:
        """Blobs, and what a writer that was killed left behind."""
        return (file for file in self._root.glob("??/*") if file.is_file())

    def _place(self, blob_id: str) -> Path:
        if not _ID.fullmatch(blob_id):
            raise BlobMissing(blob_id)
        return self._root / blob_id[:2] / blob_id

    def _write_beside(self, place: Path, data: bytes) -> Path:
        if self.free_bytes() < len(data):
            raise NoRoomError(f"{len(data)} bytes would leave less than the reserve free")
        beside = place.with_name(f"{place.name}.{uuid4().hex}")
        try:
            self._root.mkdir(parents=True, exist_ok=True, mode=0o700)
            if not place.parent.is_dir():
                place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                _sync(self._root)
            beside.write_bytes(data)
            _sync(beside)
        except OSError as error:
            beside.unlink(missing_ok=True)
            if error.errno in _DISK_IS_FULL:
                raise NoRoomError(str(error)) from error
            raise
        return beside


def _sync(path: Path) -> None:
    """Wait until the disk has what was written to a file, or the names in a folder."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
