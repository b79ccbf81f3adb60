"""Where the pictures are: a folder, a glob pattern, a ZIP archive, or a text file with a path in
each line."""

from __future__ import annotations

import glob
import hashlib
import os
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath, PurePosixPath

SUFFIXES = frozenset(
    {".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".gif", ".bmp", ".tif", ".tiff", ".webp"}
)
VIDEOS = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".wmv"})
_UNREADABLE = (OSError, zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, EOFError)
_LONGEST_PART = 200
"""Bytes of a file name; file systems allow 255, and ours get something appended."""


class SourceError(ValueError):
    """There are no pictures where the source points; the message states what was looked at."""


class PictureUnreadable(Exception):
    """One picture cannot be read, or would not hold still; the message states why."""


@dataclass(frozen=True)
class SourcePicture:
    """``name``: its path within the source, ``/`` between folders, no ``..``: labels are filed
    under it. ``stamp``: size and time of change, to notice another version; None while the file
    cannot be seen."""

    name: str
    read: Callable[[], bytes]
    stamp: Callable[[], str | None]


class Found(list[SourcePicture]):
    """The pictures of a source. ``source``: where it is, from anywhere; ``skipped``: suffixes of
    its other files → how many there are."""

    def __init__(
        self, pictures: Iterable[SourcePicture], source: str, skipped: Mapping[str, int]
    ) -> None:
        super().__init__(pictures)
        self.source, self.skipped = source, dict(skipped)


def find_pictures(source: str | os.PathLike[str], skip: Path | None = None) -> Found:
    """All pictures of ``source`` in a fixed order; what is under the folder ``skip``, hidden
    files and what a Mac adds to archives are left out.

    Raises SourceError.
    """
    text, path = os.fspath(source), Path(source)
    skipped: Counter[str] = Counter()
    taken = partial(_is_picture, skipped)
    if path.is_dir():
        found = _named(
            (file, file.relative_to(path))
            for file in _walk(path, skip)
            if taken(file.relative_to(path))
        )
    elif path.is_file() and zipfile.is_zipfile(path):
        found = _members(path, taken)
    elif path.is_file() and path.suffix.lower() in SUFFIXES:
        found = _named([(path, Path(path.name))])
    elif path.is_file():
        found = _named(_listed(path))
    elif glob.has_magic(text):
        root = _root_of(text)
        files = sorted(Path(match) for match in glob.glob(text, recursive=True))  # noqa: PTH207
        found = _named(
            (f, _below(f, root)) for f in files if f.is_file() and taken(_below(f, root))
        )
    else:
        raise SourceError(f"{text}: there is no such folder, archive, list or picture")
    if not found:
        others = f"; there are {_counted(skipped)}" if skipped else ""
        raise SourceError(f"{text}: no pictures there ({', '.join(sorted(SUFFIXES))}){others}")
    return Found(found, os.path.abspath(text), skipped)  # noqa: PTH100


def _is_picture(skipped: Counter[str], file: PurePath) -> bool:
    """By its suffix; others are counted, hidden ones and resource forks (``__MACOSX/._a.jpg``) not
    even that."""
    if any(
        part.startswith(".") or part == "__MACOSX" for part in file.parts if part not in (".", "..")
    ):
        return False
    if file.suffix.lower() in SUFFIXES:
        return True
    skipped[file.suffix.lower() or "without a suffix"] += 1
    return False


def _counted(skipped: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {suffix}" for suffix, count in skipped.items())


def picture_names(files: Iterable[Path]) -> list[str]:
    """The last part of each path, told apart where two are the same."""
    names = _Names()
    return [names.take(file.name) for file in files]


def read_still(picture: SourcePicture) -> tuple[bytes, str]:
    """The bytes, and the stamp of the version they are. Raises PictureUnreadable."""
    try:
        for _ in range(3):
            before = picture.stamp()
            data = picture.read()
            after = picture.stamp()
            if before == after and before is not None:
                return data, before
    except _UNREADABLE as error:
        raise PictureUnreadable(
            getattr(error, "strerror", None) or str(error) or type(error).__name__
        ) from error
    raise PictureUnreadable("it changes while it is read")


def _walk(folder: Path, skip: Path | None) -> Iterator[Path]:
    skipped = skip.resolve() if skip is not None else None
    for at, folders, files in os.walk(folder):
        here = Path(at)
        folders[:] = sorted(
            f for f in folders if not f.startswith(".") and (here / f).resolve() != skipped
        )
        yield from (here / name for name in sorted(files))


def _listed(file: Path) -> Iterator[tuple[Path, Path]]:
    """Every line is a path, absolute or from the list's folder. A missing one is kept: it is then
    reported."""
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise SourceError(
            f"{file}: neither a picture, an archive nor a list of paths in UTF-8"
        ) from error
    for line in (text.strip() for text in lines):
        if line and not line.startswith("#"):
            yield file.parent / line, Path(line)


def _named(files: Iterable[tuple[Path, Path]]) -> list[SourcePicture]:
    names = _Names()
    return [
        SourcePicture(names.take(inside.as_posix()), file.read_bytes, _stamper(file))
        for file, inside in files
    ]


def _stamper(file: Path) -> Callable[[], str | None]:
    def stamp() -> str | None:
        try:
            seen = file.stat()
        except OSError:
            return None
        return f"{seen.st_size}:{seen.st_mtime_ns}"

    return stamp


def _members(path: Path, taken: Callable[[PurePath], bool]) -> list[SourcePicture]:
    """The archive stays open: finding its table of contents anew for every picture would take
    longer than reading."""
    names = _Names()
    archive = zipfile.ZipFile(path)
    infos = [i for i in archive.infolist() if not i.is_dir() and taken(PurePosixPath(i.filename))]
    return [
        SourcePicture(
            names.take(i.filename), partial(archive.read, i), _constant(f"{i.file_size}:{i.CRC}")
        )
        for i in infos
    ]


def _constant(stamp: str) -> Callable[[], str]:
    return lambda: stamp


def _root_of(pattern: str) -> Path:
    """The folders before the first wildcard."""
    parts = Path(pattern).parts
    plain = next((k for k, part in enumerate(parts) if glob.has_magic(part)), len(parts))
    return Path(*parts[:plain])


def _below(file: Path, root: Path) -> Path:
    return file.relative_to(root) if file.is_relative_to(root) else file


class _Names:
    """Names that stay inside a folder, are valid text, and are told apart even where case does not
    count."""

    def __init__(self) -> None:
        self._taken: set[str] = set()
        self._counts: dict[str, int] = {}

    def take(self, wanted: str) -> str:
        text = (
            wanted.replace("\\", "/")
            .encode("utf-8", "surrogateescape")
            .decode("utf-8", "backslashreplace")
        )
        parts = [_part(p) for p in PurePosixPath(text).parts if p not in ("/", "..", ".")]
        clean = "/".join(parts) or "picture"
        # Counting goes on where it was: a list may name one picture a hundred thousand times.
        name, count = clean, self._counts.get(clean.casefold(), 1)
        while name.casefold() in self._taken:
            count += 1
            at = PurePosixPath(clean)
            name = str(at.with_name(f"{at.stem}-{count}{at.suffix}"))
        self._counts[clean.casefold()] = count
        self._taken.add(name.casefold())
        return name


def _part(part: str) -> str:
    """A component that is not too long with what we append."""
    raw = part.replace(":", "_").encode()
    if len(raw) <= _LONGEST_PART:
        return raw.decode()
    short = raw[:150].decode(errors="ignore")
    return f"{short}-{hashlib.sha256(raw).hexdigest()[:8]}{PurePosixPath(part).suffix[:10]}"
