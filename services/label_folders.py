"""Label folders that `dlo label` filled, for the label bench: read, and saved so that nobody
overwrites another's work.

A changed label is a draft until somebody confirms it; then it is a correction, as ``dlo
label-import`` files it. Drafts train nothing. Names are those of the folder's ledger, so no path
leads out of it.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Literal

from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.sources import (
    PictureUnreadable,
    SourceError,
    SourcePicture,
    find_pictures,
    read_still,
)
from dlo_client.labelling.store import (
    LEDGER,
    Entry,
    LabelStore,
    StoreError,
    corrected_file,
    draft_file,
    write_whole,
)
from pydantic import ValidationError

from services.fields import body_problems
from services.problems import MOST_ERRORS, ProblemError, field_error, fields_error

State = Literal["new", "changed", "confirmed"]
_SOURCE_KEPT_S = 60.0
_LOCK = ".bench.lock"


@dataclass(frozen=True)
class Kept:
    """A label as it is in the folder, and the tag of exactly these bytes."""

    content: bytes
    state: State

    @property
    def etag(self) -> str:
        return f'"{hashlib.sha256(self.content).hexdigest()}"'


class LabelFolders:
    """The folders below ``root``; none without it."""

    def __init__(self, root: Path | None) -> None:
        self._root = root
        self._sources: dict[str, tuple[float, dict[str, SourcePicture]]] = {}
        self._guard = Lock()

    def names(self) -> list[str]:
        if self._root is None or not self._root.is_dir():
            return []
        return sorted(folder.name for folder in self._root.iterdir() if (folder / LEDGER).is_file())

    def entries(self, folder: str) -> list[tuple[Entry, State]]:
        """Every picture that has a label. Raises ProblemError."""
        with self._store(folder) as store:
            return [
                (e, _state(store.folder, e.name))
                for e in store.entries().values()
                if e.state != "failed"
            ]

    def read(self, folder: str, name: str) -> Kept:
        """Raises ProblemError: unknown folder or picture."""
        with self._store(folder) as store:
            return _kept(store, _entry(store, name))

    def write(self, folder: str, name: str, content: bytes, if_match: str) -> Kept:
        """Save a label if the one that is there is still the one that ``if_match`` names.

        Raises ProblemError: 412 when it is another one by now; 409 for a label of another picture;
        422.
        """
        label = _label(content)
        with self._store(folder) as store:
            entry = _entry(store, name)
            _check_belongs(label, entry, store.label(name))
            with _locked(store.folder):
                if _kept(store, entry).etag != if_match:
                    raise ProblemError(
                        412, "changed_meanwhile", "somebody else saved this label meanwhile"
                    )
                _file(
                    store.folder,
                    label.model_copy(update={"name": name, "sha256": entry.sha256 or label.sha256}),
                )
            return _kept(store, entry)

    def picture(self, folder: str, name: str) -> bytes:
        """The bytes that were labelled. Raises ProblemError: gone, or others by now."""
        with self._store(folder) as store:
            entry, source = _entry(store, name), store.source()
        picture = self._pictures(source).get(name) if source else None
        if picture is None:
            raise ProblemError(
                404, "unknown_image", "the picture is no longer where it was labelled"
            )
        try:
            content, _ = read_still(picture)
        except PictureUnreadable as error:
            raise ProblemError(
                404, "unknown_image", f"the picture cannot be read: {error}"
            ) from None
        if entry.sha256 and hashlib.sha256(content).hexdigest() != entry.sha256:
            raise ProblemError(
                409, "other_image", "the picture has other bytes than the one that was labelled"
            )
        return content

    @contextmanager
    def _store(self, folder: str) -> Iterator[LabelStore]:
        if self._root is None or folder not in self.names():
            raise ProblemError(404, "unknown_folder", "there is no label folder of this name")
        try:
            with LabelStore(self._root / folder) as store:
                yield store
        except StoreError as error:
            raise ProblemError(409, "unreadable_folder", str(error)) from None

    def _pictures(self, source: str) -> dict[str, SourcePicture]:
        """By name; going through a large folder for every picture would take longer than reading
        it."""
        with self._guard:
            made, found = self._sources.get(source, (0.0, {}))
            if time.monotonic() - made > _SOURCE_KEPT_S or not found:
                try:
                    found = {picture.name: picture for picture in find_pictures(source)}
                except SourceError:
                    found = {}
                self._sources[source] = (time.monotonic(), found)
            return found


def _entry(store: LabelStore, name: str) -> Entry:
    entry = store.entries().get(name)
    if entry is None or entry.state == "failed":
        raise ProblemError(404, "unknown_image", "no picture of this name was labelled there")
    return entry


def _state(folder: Path, name: str) -> State:
    if draft_file(folder, name).exists():
        return "changed"
    return "confirmed" if corrected_file(folder, name).exists() else "new"


def _kept(store: LabelStore, entry: Entry) -> Kept:
    state = _state(store.folder, entry.name)
    files = {"changed": draft_file, "confirmed": corrected_file}
    file = (
        files[state](store.folder, entry.name) if state in files else store.label_file(entry.name)
    )
    try:
        return Kept(file.read_bytes(), state)
    except OSError as error:
        raise StoreError(f"{entry.name}: its label cannot be read: {error.strerror}") from error


def _label(content: bytes) -> PictureLabel:
    try:
        return PictureLabel.model_validate_json(content)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_input=False)
        given = None if errors[0]["type"] == "json_invalid" else json.loads(content)
        problems = body_problems(errors[:MOST_ERRORS], given, whole="label")
        raise fields_error(problems, len(errors)) from None


def _check_belongs(label: PictureLabel, entry: Entry, before: PictureLabel) -> None:
    if entry.sha256 and label.sha256 and label.sha256 != entry.sha256:
        raise ProblemError(409, "other_image", "this is a label of a picture with other bytes")
    if (label.width, label.height) != (before.width, before.height):
        raise field_error("width", f"the picture is {before.width}×{before.height}")


def _file(folder: Path, label: PictureLabel) -> None:
    confirmed = label.origin == "corrected"
    place = corrected_file if confirmed else draft_file
    write_whole(place(folder, label.name), label.model_dump_json().encode())
    if confirmed:
        draft_file(folder, label.name).unlink(missing_ok=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Between comparing a label and replacing it nobody else does either, whichever replica
    answers."""
    with (folder / _LOCK).open("a") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
