"""The output folder: a label file for every picture, and a ledger of what became of each.

A label is written beside its place and renamed; then the ledger notes it. Killed between the two,
the picture is labelled again, by the same job where the service still knows it. The ledger is an
SQLite file: whatever moment the process dies at, it holds every picture exactly once. One run at a
time: a second one is refused.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from pydantic import ValidationError

from dlo_client.labelling.labels import PictureLabel

State = Literal["done", "duplicate", "failed"]
LEDGER = "ledger.sqlite"
LABELS = "labels"
CORRECTED = "corrected"
DRAFTS = "drafts"
_SCHEMA = """
CREATE TABLE IF NOT EXISTS pictures (
    name TEXT PRIMARY KEY, state TEXT NOT NULL, stamp TEXT NOT NULL, sha256 TEXT NOT NULL, detail TEXT NOT NULL,
    certainty REAL NOT NULL, seconds REAL NOT NULL);
CREATE INDEX IF NOT EXISTS by_content ON pictures (sha256, state);
CREATE TABLE IF NOT EXISTS settings (key TEXT PRIMARY KEY, value TEXT NOT NULL);
"""


class StoreError(Exception):
    """The output folder cannot be used, or is full: the message states why. What was written before
    is kept."""


@dataclass(frozen=True)
class Entry:
    """What became of one picture. ``detail``: why it failed, what it is a duplicate of, or what is
    uncertain; ``stamp``: the version of the file that this is about."""

    name: str
    state: State
    stamp: str = ""
    sha256: str = ""
    detail: str = ""
    certainty: float = 0.0
    seconds: float = 0.0


class LabelStore:
    """An output folder, opened for one run or for reading. Use as a context manager."""

    def __init__(self, folder: Path, *, write: bool = False) -> None:
        """Raises StoreError: not writable, in use by another run, or nothing there to read."""
        self.folder = folder
        self._lock: int | None = None
        if not write and not (folder / LEDGER).exists():
            raise StoreError(f"{folder}: no labels there ({LEDGER} is missing)")
        try:
            if write:
                (folder / LABELS).mkdir(parents=True, exist_ok=True)
                self._lock = self._locked()
            self._ledger = sqlite3.connect(folder / LEDGER, timeout=10)
            if write:
                self._ledger.execute("PRAGMA journal_mode=WAL")
                self._ledger.execute("PRAGMA synchronous=NORMAL")
                self._ledger.executescript(_SCHEMA)
        except (OSError, sqlite3.Error) as error:
            self._unlock()
            raise StoreError(
                f"{folder}: cannot be written: {getattr(error, 'strerror', None) or error}"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ledger.close()
        self._unlock()

    def put(self, entry: Entry, label: PictureLabel | None = None) -> None:
        """Note what became of a picture, after its label is safely there. Raises StoreError: disk
        full."""
        with self._written():
            if label is not None:
                write_whole(self.label_file(entry.name), label.model_dump_json().encode())
            self._ledger.execute(
                "INSERT OR REPLACE INTO pictures VALUES (?, ?, ?, ?, ?, ?, ?)", astuple(entry)
            )

    def entries(self) -> dict[str, Entry]:
        """All that is known, by name. Raises StoreError: the ledger is damaged, or cannot be opened
        where it is."""
        try:
            rows = self._ledger.execute("SELECT * FROM pictures ORDER BY name").fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"{self.folder / LEDGER}: cannot be read: {error}") from error
        return {row[0]: Entry(*row) for row in rows}

    def twin_of(self, sha256: str, name: str) -> str | None:
        """Another picture with the same bytes that has a label."""
        row = self._ledger.execute(
            "SELECT name FROM pictures WHERE sha256 = ? AND state = 'done' AND name != ?",
            (sha256, name),
        ).fetchone()
        return str(row[0]) if row else None

    def remember(self, settings: dict[str, object]) -> None:
        """What the labels are made with. Raises StoreError when those that are there were made with
        something else."""
        told = json.dumps(settings, sort_keys=True)
        with self._written():
            row = self._ledger.execute(
                "SELECT value FROM settings WHERE key = 'request'"
            ).fetchone()
            if row is not None and row[0] != told:
                raise StoreError(
                    f"{self.folder}: its labels were made with {row[0]}, not {told}: take another folder"
                )
            self._ledger.execute("INSERT OR REPLACE INTO settings VALUES ('request', ?)", (told,))

    def remember_source(self, source: str) -> None:
        """Where the pictures are, for exports that need them."""
        with self._written():
            self._ledger.execute("INSERT OR REPLACE INTO settings VALUES ('source', ?)", (source,))

    def source(self) -> str | None:
        """Where the pictures were when they were labelled last."""
        row = self._ledger.execute("SELECT value FROM settings WHERE key = 'source'").fetchone()
        return str(row[0]) if row else None

    def label_file(self, name: str) -> Path:
        return self.folder / LABELS / f"{name}.json"

    def label(self, name: str) -> PictureLabel:
        """Raises StoreError: not there, or not a label."""
        return read_label(self.label_file(name))

    def labels(self) -> Iterator[PictureLabel]:
        """The labels of all pictures that have one, by name."""
        for entry in self.entries().values():
            if entry.state != "failed":
                yield self.label(entry.name)

    @contextmanager
    def _written(self) -> Iterator[None]:
        """One step of the ledger; StoreError when the folder takes nothing more."""
        try:
            with self._ledger:
                yield
        except (OSError, sqlite3.Error) as error:
            raise StoreError(
                f"{self.folder}: {getattr(error, 'strerror', None) or error}"
            ) from error

    def _locked(self) -> int:
        handle = os.open(self.folder / ".lock", os.O_CREAT | os.O_RDWR, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(handle)
            raise StoreError(f"{self.folder}: another run is writing here") from error
        return handle

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def corrected_file(folder: Path, name: str) -> Path:
    """Where the correction of a picture is."""
    return folder / CORRECTED / f"{name}.json"


def draft_file(folder: Path, name: str) -> Path:
    """Where a label is that somebody changed and nobody has confirmed: no correction yet."""
    return folder / DRAFTS / f"{name}.json"


def read_label(file: Path) -> PictureLabel:
    """Raises StoreError: not there, or not a label."""
    try:
        return PictureLabel.model_validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        raise StoreError(f"{file}: no label: {error}") from error


def write_whole(file: Path, content: bytes) -> None:
    """Written beside its place and renamed: a reader never sees half a file. Raises OSError."""
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_name(f".{file.name[-100:]}.part")
    try:
        temporary.write_bytes(content)
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)
