"""Which picture of a folder a label from elsewhere belongs to: by its bytes first, then by its
name."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from pathlib import PurePosixPath

from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.store import Entry, StoreError

_DRIVE = re.compile(r"^[A-Za-z]:/")
_SHOWN = 3


class Pictures:
    """The pictures of a folder, to be found again.

    A label's SHA-256 decides where it has one; a name that means another picture then is a contradiction. Names are
    compared from their last part to the front, so that folders that a tool put before them, or left out, do not matter.
    ``\\`` is ``/``; composed and decomposed letters are the same, and upper and lower case where nothing fits better;
    a name without a suffix (a frame of a video) fits any suffix.
    """

    def __init__(self, entries: Mapping[str, Entry]) -> None:
        self._entries = {name: entry for name, entry in entries.items() if entry.state != "failed"}
        self._by_content: dict[str, list[str]] = {}
        self._by_last: dict[str, list[str]] = {}
        for name, entry in self._entries.items():
            if entry.sha256:
                self._by_content.setdefault(entry.sha256, []).append(name)
            last = _parts(name)[-1].casefold()
            for key in {last, PurePosixPath(last).stem}:
                self._by_last.setdefault(key, []).append(name)

    def find(self, label: PictureLabel) -> str:
        """Raises StoreError: none, several, or a contradiction; the message names them."""
        named = self._named(label.name)
        if label.sha256:
            same = self._by_content.get(label.sha256.lower(), [])
            if same:
                return self._of_content(label.name, same, named)
            if named and all(self._entries[name].sha256 for name in named):
                raise StoreError(
                    f"{_list(named)} has this name, but other bytes: labels of another picture"
                )
        if not named:
            raise StoreError("no picture of this name was labelled here")
        if len(named) > 1:
            raise StoreError(f"ambiguous: {_list(named)}")
        return named[0]

    def _of_content(self, name: str, same: list[str], named: list[str]) -> str:
        both = [other for other in named if other in same]
        if named and not both:
            raise StoreError(
                f"contradiction: its bytes are those of {_list(same)}, its name is that of {_list(named)}"
            )
        candidates = both or same
        if len(candidates) > 1:
            raise StoreError(f"ambiguous: {_list(candidates)}, which have the same bytes")
        return candidates[0]

    def _named(self, name: str) -> list[str]:
        """All that the name fits equally well."""
        if name in self._entries:
            return [name]
        parts = _parts(name)
        last = parts[-1].casefold()
        has_suffix = bool(PurePosixPath(last).suffix)
        near = [
            n
            for n in self._by_last.get(last, [])
            if has_suffix or PurePosixPath(n).stem.casefold() == last
        ]
        exact = [n for n in near if _fitting(_parts(n), parts)] or near
        fits = {
            n: _fitting(_parts(n), parts) or _fitting(_folded(_parts(n)), _folded(parts))
            for n in exact
        }
        best = max(fits.values(), default=0)
        return [n for n, fit in fits.items() if fit == best]


def _parts(name: str) -> list[str]:
    text = unicodedata.normalize("NFC", name.replace("\\", "/"))
    parts = [
        part for part in PurePosixPath(_DRIVE.sub("", text)).parts if part not in ("/", ".", "..")
    ]
    return parts or [text]


def _folded(parts: list[str]) -> list[str]:
    return [part.casefold() for part in parts]


def _fitting(known: list[str], given: list[str]) -> int:
    """How many parts are the same, counted from the last, which may lack its suffix."""
    count = 0
    for a, b in zip(reversed(known), reversed(given), strict=False):
        if a != b and not (count == 0 and PurePosixPath(a).stem == b):
            break
        count += 1
    return count


def _list(names: list[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return " or ".join(names[:_SHOWN]) + more
