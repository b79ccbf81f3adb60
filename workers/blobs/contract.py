"""What every place for blobs does."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol


class BlobMissing(KeyError):
    """No blob has this id: it was never put, it has expired, or the id is not one."""


class NoRoomError(Exception):
    """There is no room for more."""


class BlobsUnreachableError(OSError):
    """The place that holds the blobs does not answer, or does not let us in."""


class Staged(Protocol):
    """Bytes that are written down but are no blob yet, unless they were one before."""

    @property
    def blob_id(self) -> str: ...

    @property
    def bytes(self) -> int: ...

    @property
    def is_new(self) -> bool:
        """Whether no blob had these bytes before."""

    def keep(self) -> str:
        """Make a blob of them; its id. May be called again."""

    def drop(self) -> None:
        """Forget them; nothing happens to a blob."""


class Blobs(Protocol):
    """Blobs by the SHA-256 of their bytes; one lives for a time after it was last put or touched.

    Every method raises BlobsUnreachableError where the place is on another machine that does not
    answer.
    """

    place: str
    """For people: where they are."""

    def put(self, data: bytes) -> str:
        """Store ``data`` and return its id; the same bytes are stored once. Raises NoRoomError."""

    def stage(self, data: bytes) -> Staged:
        """Write ``data`` down, to be kept or dropped; raises NoRoomError."""

    def get(self, blob_id: str) -> bytes:
        """The bytes; raises BlobMissing."""

    def path(self, blob_id: str) -> Path | None:
        """The file that holds the bytes, None where no file does; raises BlobMissing."""

    def touch(self, blob_id: str) -> bool:
        """Start the lifetime anew; False if there is no such blob."""

    def let_go(self, staged: Staged, after_s: float) -> None:
        """Where the place can, let what ``staged`` made a blob be swept away ``after_s`` seconds
        from now, unless it is touched again or was one before."""

    def sweep(self, now: float | None = None) -> int:
        """Remove what has outlived its lifetime at ``now`` (seconds since the epoch); return how
        many."""

    def mark(self, *, make: bool = False) -> str | None:
        """An id of the place, the same for everybody who shares it; None if it has none and none is
        to be made."""
