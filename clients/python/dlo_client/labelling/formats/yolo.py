"""YOLO segmentation (Ultralytics): ``dataset.yaml``, the pictures, and a text file a picture with a
line an instance.

A line holds one polygon. The pieces of an interrupted DLO are joined by cuts of no width, as
Ultralytics' own converter does it. Centerlines and crossings have no place here. About one picture
in ten is for validation, by its content: one of the same bytes is on the same side, and the side
does not change from export to export.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import numpy as np

from dlo_client.labelling.formats.exchange import CLASS, FormatError, Labels, written_whole
from dlo_client.labelling.formats.names import stem, stem_and_suffix, told_apart
from dlo_client.labelling.formats.pixels import Mask, decode, fill, joined, outlines
from dlo_client.labelling.labels import LabelledInstance, PictureLabel
from dlo_client.labelling.sources import PictureUnreadable, SourcePicture, read_still

_VALIDATION = 0.1
_RENAMED = {".jfif": ".jpg", ".jpe": ".jpg"}
"""Suffixes that Ultralytics does not know, of files that it reads."""


def write(
    labels: Labels,
    out: Path,
    pictures: Mapping[str, SourcePicture] | None = None,
    problems: dict[str, str] | None = None,
) -> Path:
    """``yolo/dataset.yaml``, ``yolo/labels/train|val/NAME.txt`` and, of ``pictures`` by name,
    ``yolo/images/…``.

    Labels whose picture is missing or cannot be read are left out; ``problems`` then gets name →
    why. Without ``pictures`` ``yolo/images.json`` states where each belongs, by its name. What an
    earlier export left in these two folders is replaced.
    """
    folder = out / "yolo"
    fresh = out / ".yolo.part"
    shutil.rmtree(fresh, ignore_errors=True)
    try:
        places = _places(labels)
        for label in labels():
            place = places[label.name]
            try:
                if pictures is not None:
                    _copy(pictures.get(label.name), fresh / _image(label.name, place))
            except PictureUnreadable as error:
                (problems if problems is not None else {})[label.name] = str(error)
                continue
            with written_whole(fresh / "labels" / f"{place}.txt") as file:
                file.writelines(_line(item, label) for item in label.instances)
        for part in ("labels", "images"):
            if (fresh / part).exists():
                shutil.rmtree(folder / part, ignore_errors=True)
                folder.mkdir(parents=True, exist_ok=True)
                (fresh / part).replace(folder / part)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    with written_whole(folder / "dataset.yaml") as file:
        val = "val" if (folder / "labels" / "val").exists() else "train"
        file.write(f"train: images/train\nval: images/{val}\nnames:\n  0: {CLASS}\n")
    if pictures is None:
        with written_whole(folder / "images.json") as file:
            json.dump({name: _image(name, place) for name, place in places.items()}, file)
    return folder


def masks_of(text: str, height: int, width: int) -> list[Mask]:
    """The masks that the lines of a label file describe. Raises FormatError."""
    masks = []
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            values = np.array(line.split()[1:], float).reshape(-1, 2)
        except ValueError as error:
            raise FormatError(f"line {number}: {error}") from error
        masks.append(fill([values * (width, height)], height, width))
    return masks


def _places(labels: Labels) -> dict[str, PurePosixPath]:
    """Side and file of each label, without a suffix, by its name."""
    sides = _sides({label.name: label.sha256 or label.name for label in labels()})
    files = told_apart(sides, _short, _long)
    return {name: PurePosixPath(side, files[name]) for name, side in sides.items()}


def _image(name: str, place: PurePosixPath) -> str:
    return f"images/{place}{_suffix(name)}"


def _sides(contents: Mapping[str, str]) -> dict[str, str]:
    """``train`` or ``val`` by a digest of the content; with two contents or more neither is
    empty."""
    share = {
        c: int(hashlib.sha256(c.encode()).hexdigest()[:8], 16) / 2**32
        for c in set(contents.values())
    }
    held = {c for c, at in share.items() if at < _VALIDATION}
    ranked = sorted(share, key=lambda c: share[c])
    if len(ranked) > 1 and not held:
        held = {ranked[0]}
    elif len(ranked) == len(held):
        held = set(ranked[:-1])
    return {name: "val" if content in held else "train" for name, content in contents.items()}


def _short(name: str) -> str:
    """All in one folder: not every reader looks into those below, and Ultralytics finds a label by
    the last folder ``images`` of its picture's path."""
    return stem(name).replace("/", "__")


def _long(name: str) -> str:
    return stem_and_suffix(name).replace("/", "__")


def _suffix(name: str) -> str:
    suffix = PurePosixPath(name).suffix
    return _RENAMED.get(suffix.lower(), suffix)


def _copy(picture: SourcePicture | None, file: Path) -> None:
    """A copy, because Ultralytics repairs broken pictures where they lie. Raises
    PictureUnreadable."""
    if picture is None:
        raise PictureUnreadable("the picture is not in the source")
    data, _ = read_still(picture)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def _line(item: LabelledInstance, label: PictureLabel) -> str:
    """Class 0 and the polygon in shares of the picture; nothing for an instance that is hidden
    altogether."""
    rings = outlines(decode(item.mask_rle))
    if not rings:
        return ""
    shares = joined(rings) / (label.width, label.height)
    return f"0 {' '.join(f'{v:.7f}' for v in shares.ravel())}\n"
