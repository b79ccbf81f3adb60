"""Labels in any form as the archive that an ``adapt`` job learns from. Needs
``dlo-client[label]``."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import numpy as np
from PIL import Image

from dlo_client.labelling.formats import READERS, Wanted
from dlo_client.labelling.formats.pixels import decode
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.matching import Pictures
from dlo_client.labelling.sources import PictureUnreadable, SourcePicture, find_pictures, read_still
from dlo_client.labelling.store import (
    CORRECTED,
    Entry,
    LabelStore,
    StoreError,
    corrected_file,
    read_label,
)
from dlo_client.labelling.upright import upright

_LONGEST_PX = 1920
"""Larger pictures are reduced before they travel: no network sees more of them."""
_QUALITY = 95


@dataclass
class Packed:
    """``archive``: ZIP of ``NAME.jpg`` and ``NAME_ids.png``; ``names`` of its pictures;
    ``problems``: name → why a label is not."""

    archive: bytes = b""
    names: list[str] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)


def pack_store(folder: Path, pictures: str | None = None, *, everything: bool = False) -> Packed:
    """The corrected labels of a folder that ``dlo label`` filled (``everything``: all of them).

    ``pictures``: where they are by now. Raises StoreError, SourceError.
    """
    with LabelStore(folder) as store:
        where = pictures or store.source()
        if where is None:
            raise StoreError(f"{folder}: it is not known where its pictures are; name their place")
        found = {picture.name: picture for picture in find_pictures(where, skip=folder)}
        labels = []
        for name, entry in store.entries().items():
            corrected = corrected_file(folder, name)
            if corrected.exists():
                labels.append(read_label(corrected))
            elif everything and entry.state != "failed":
                labels.append(store.label(name))
    return pack(labels, found)


def pack_foreign(file: Path, tool: str, pictures: str, wanted: Wanted) -> Packed:
    """The labels that another tool exported. Raises FormatError, SourceError."""
    imported = READERS[tool](file, wanted)
    found = {picture.name: picture for picture in find_pictures(pictures)}
    entries = {
        name: Entry(name, "done", sha256=_digest(picture)) for name, picture in found.items()
    }
    by_name = Pictures(entries)
    problems, named = imported.problems | imported.not_annotated, []
    for label in imported.labels:
        if label.origin != CORRECTED:
            problems[label.name] = f"nobody confirmed it: its origin is {label.origin}"
            continue
        try:
            named.append(label.model_copy(update={"name": by_name.find(label)}))
        except StoreError as error:
            problems[label.name] = str(error)
    packed = pack(named, found)
    packed.problems = problems | packed.problems
    return packed


def pack(labels: Iterable[PictureLabel], pictures: dict[str, SourcePicture]) -> Packed:
    """Every label with its picture, by name; one whose picture is gone, or of another size, is
    named and left out."""
    packed, out = Packed(), io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for label in labels:
            try:
                picture, ids = _pair(label, pictures.get(label.name))
            except PictureUnreadable as error:
                packed.problems[label.name] = str(error)
                continue
            stem = f"{len(packed.names):04d}_{label.name.rsplit('.', 1)[0].replace('/', '__')}"
            archive.writestr(zipfile.ZipInfo(f"{stem}.jpg"), _encoded(picture, "JPEG"))
            archive.writestr(zipfile.ZipInfo(f"{stem}_ids.png"), _encoded(ids, "PNG"))
            packed.names.append(label.name)
    packed.archive = out.getvalue()
    return packed


def _pair(label: PictureLabel, source: SourcePicture | None) -> tuple[Image.Image, Image.Image]:
    """Picture and cable (255) of one label, reduced alike. Raises PictureUnreadable."""
    image = upright(source, label)
    mask = np.zeros((label.height, label.width), bool)
    for item in label.instances:
        mask |= decode(item.mask_rle)
    ids = Image.fromarray(mask.astype(np.uint8) * 255, "L")
    factor = _LONGEST_PX / max(image.size)
    if factor < 1:
        size = round(image.width * factor), round(image.height * factor)
        image, ids = (
            image.resize(size, Image.Resampling.BOX),
            ids.resize(size, Image.Resampling.NEAREST),
        )
    return image, ids


def _encoded(image: Image.Image, form: str) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, form, **({"quality": _QUALITY, "subsampling": 0} if form == "JPEG" else {}))
    return buffer.getvalue()


def _digest(picture: SourcePicture) -> str:
    try:
        return sha256(read_still(picture)[0]).hexdigest()
    except PictureUnreadable:
        return ""
