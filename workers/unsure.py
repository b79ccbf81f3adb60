"""The pictures that the service was least sure of, for their owners to correct: bounded, and only
where it may.

Strategy: a folder an owner, a picture two files named by its certainty, so that the surest are the
last by name and go first when there are too many. The picture itself is written last: one without
it is not there.
"""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime

from dlo_client.contracts.unsure import UnsurePicture

from workers.networks.files import Files, open_files
from workers.settings import Settings

_NOBODY = "_"
"""The folder of those who call without a key."""
_PICTURE, _ABOUT = ".picture", ".json"


class UnsureStore:
    """At most ``most`` pictures an owner."""

    def __init__(self, files: Files, most: int) -> None:
        self._files, self._most = files, most

    @classmethod
    def of(cls, settings: Settings) -> UnsureStore:
        """The one of a service and its workers."""
        return cls(open_files(settings, "unsure"), settings.unsure_pictures)

    def offer(self, owner: str, picture: bytes, certainty: float, doubt: str) -> bool:
        """Keep ``picture`` if it is among those that the service was least sure of; whether it
        is."""
        if self._most == 0:
            return False
        digest, folder = hashlib.sha256(picture).hexdigest(), owner or _NOBODY
        name = f"{certainty:.6f}-{digest}"
        with self._files.locked(folder):
            there = self._names(folder)
            twin = next((known for known in there if known.endswith(digest)), None)
            if twin is not None:
                return True
            if len(there) >= self._most and name >= there[-1]:
                return False
            about = UnsurePicture(
                id=digest,
                certainty=certainty,
                doubt=doubt,
                bytes=len(picture),
                seen_at=datetime.now(UTC),
            )
            self._files.write(folder, name + _ABOUT, about.model_dump_json().encode())
            self._files.write(folder, name + _PICTURE, picture)
            for surest in self._names(folder)[self._most :]:
                self._remove(folder, surest)
        return True

    def listed(self, owner: str) -> list[UnsurePicture]:
        """The least sure first."""
        folder, found = owner or _NOBODY, []
        for name in self._names(folder):
            try:
                found.append(
                    UnsurePicture.model_validate_json(self._files.read(folder, name + _ABOUT))
                )
            except FileNotFoundError:
                continue  # it has just been dropped
        return found

    def picture(self, owner: str, digest: str) -> bytes:
        """Raises FileNotFoundError."""
        folder = owner or _NOBODY
        return self._files.read(folder, self._named(folder, digest) + _PICTURE)

    def drop(self, owner: str, digest: str) -> None:
        """Raises FileNotFoundError."""
        folder = owner or _NOBODY
        with self._files.locked(folder):
            self._remove(folder, self._named(folder, digest))

    def _names(self, folder: str) -> list[str]:
        """By certainty."""
        return [f.removesuffix(_PICTURE) for f in self._files.names(folder) if f.endswith(_PICTURE)]

    def _named(self, folder: str, digest: str) -> str:
        for name in self._names(folder):
            if name.endswith(f"-{digest}"):
                return name
        raise FileNotFoundError(digest)

    def _remove(self, folder: str, name: str) -> None:
        self._files.remove(folder, name + _PICTURE)
        self._files.remove(folder, name + _ABOUT)
