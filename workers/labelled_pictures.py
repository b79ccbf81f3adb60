"""An archive of labelled pictures: what is in it, before anything is taken out. Imports nothing
that computes."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import PurePosixPath

LEAST, MOST = 5, 500
"""Pictures of an archive."""
_IDS = "_ids.png"
_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
_MOST_MEMBERS = 4 * MOST
_MOST_UNPACKED = 4
"""Times the bytes of the archive: pictures are compressed already, anything beyond is a bomb."""


class ArchiveError(ValueError):
    """The bytes are no such archive; the message states what is wrong with them."""


@dataclass(frozen=True)
class Labelled:
    """A picture and the ids of its cables, as members of the archive."""

    name: str
    picture: str
    ids: str


def pairs_of(data: bytes) -> list[Labelled]:
    """The labelled pictures by name; folders are part of it. Raises ArchiveError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = [info for info in archive.infolist() if not info.is_dir()]
    except (zipfile.BadZipFile, NotImplementedError, OSError) as error:
        raise ArchiveError(f"is no ZIP archive: {error}") from error
    if len(infos) > _MOST_MEMBERS:
        raise ArchiveError(f"holds {len(infos)} files, at most {_MOST_MEMBERS} are taken")
    if sum(info.file_size for info in infos) > _MOST_UNPACKED * len(data) + 2**20:
        raise ArchiveError("unpacks to far more than it holds")
    if any(info.flag_bits & 1 for info in infos):
        raise ArchiveError("is encrypted")
    names = {info.filename for info in infos}
    pairs = [_pair(name.removesuffix(_IDS), names) for name in sorted(names) if name.endswith(_IDS)]
    if not LEAST <= len(pairs) <= MOST:
        raise ArchiveError(
            f"holds {len(pairs)} pictures with a label (NAME.png or .jpg, and NAME{_IDS}); "
            f"{LEAST} to {MOST} are needed"
        )
    return pairs


def _pair(name: str, names: set[str]) -> Labelled:
    for suffix in _PICTURES:
        for candidate in (name + suffix, name + suffix.upper()):
            if candidate in names:
                return Labelled(PurePosixPath(name).as_posix(), candidate, name + _IDS)
    raise ArchiveError(f"{name}{_IDS} has no picture beside it")
