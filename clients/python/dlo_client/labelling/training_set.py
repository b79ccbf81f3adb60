"""Labelled pictures as a training source: a folder of ``NAME.png``, ``NAME_ids.png`` and
``index.jsonl``.

That is the form in which the service's repository keeps its own rendered sets; its training mixes
such folders by ratio. The index is written last, line by line: a set that is cut off stays valid,
and the next export goes on. Needs ``dlo-client[label]``.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageStat

from dlo_client.contracts import Point
from dlo_client.labelling.formats.exchange import FormatError
from dlo_client.labelling.formats.indexed_png import ids_of
from dlo_client.labelling.formats.names import stem_and_suffix, told_apart
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.sources import PictureUnreadable, SourcePicture
from dlo_client.labelling.store import (
    LabelStore,
    StoreError,
    corrected_file,
    read_label,
    write_whole,
)
from dlo_client.labelling.upright import upright

INDEX = "index.jsonl"


def export_training_set(
    store: LabelStore,
    pictures: Iterable[SourcePicture],
    folder: Path,
    *,
    corrected_only: bool = True,
) -> dict[str, str]:
    """Write every picture of ``pictures`` that has a correction, or with ``corrected_only`` off any
    label.

    Returns name → why for those that could not be: the picture is gone, unreadable or of another
    size, or the folder is full.
    """
    by_name = {picture.name: picture for picture in pictures}
    problems: dict[str, str] = {}
    folder.mkdir(parents=True, exist_ok=True)
    written = _indexed(folder)
    sources = set(written.values())
    files = told_apart(store.entries(), _flat, _flat_and_digest)
    with (folder / INDEX).open("a", encoding="utf-8") as index:
        for name, entry in store.entries().items():
            corrected = corrected_file(store.folder, name)
            if (
                entry.state == "failed"
                or (corrected_only and not corrected.exists())
                or name in sources
            ):
                continue
            flat = files[name] if files[name] not in written else _flat_and_digest(name)
            try:
                label = read_label(corrected) if corrected.exists() else store.label(name)
                _write(folder, flat, label, by_name.get(name))
                record = {
                    "name": flat,
                    "source": name,
                    "origin": label.origin,
                    "instances": len(label.instances),
                }
                index.write(json.dumps(record) + "\n")
                index.flush()
            except (PictureUnreadable, FormatError, StoreError) as error:
                problems[name] = str(error)
            except OSError as error:
                problems[name] = f"cannot be written: {error.strerror}"
    return problems


def _write(folder: Path, flat: str, label: PictureLabel, picture: SourcePicture | None) -> None:
    image = upright(picture, label)
    for polygon in label.ignore:
        _blank(image, polygon)
    for suffix, pixels in (("_ids.png", Image.fromarray(ids_of(label), "L")), (".png", image)):
        buffer = io.BytesIO()
        pixels.save(buffer, "PNG")
        write_whole(folder / f"{flat}{suffix}", buffer.getvalue())


def _blank(image: Image.Image, polygon: Sequence[Point]) -> None:
    """Nothing is left to learn from in an ignored area: it gets the picture's mean color."""
    mean = tuple(round(value) for value in ImageStat.Stat(image).mean)
    ImageDraw.Draw(image).polygon([tuple(point) for point in polygon], fill=mean)


def _flat(name: str) -> str:
    """One folder holds them all: folders become part of the name."""
    return stem_and_suffix(name).replace("/", "__")


def _flat_and_digest(name: str) -> str:
    """Where another picture's name becomes the same: ``a/b.jpg`` and ``a__b.jpg``."""
    return f"{_flat(name)}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _indexed(folder: Path) -> dict[str, str]:
    """Name → source of what is written so far; a last line that was cut off does not count and is
    ended."""
    if not (folder / INDEX).exists():
        return {}
    content = (folder / INDEX).read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        write_whole(folder / INDEX, whole)
    records = [json.loads(line) for line in whole.splitlines()]
    return {record["name"]: record.get("source", "") for record in records}
