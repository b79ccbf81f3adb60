"""YOLO segmentation (Ultralytics): a text file a picture, a line an instance, ``dataset.yaml`` beside them.

A line holds one polygon. The pieces of an interrupted DLO are joined by cuts of no width, as Ultralytics' own
converter does it. Centerlines and crossings have no place here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlo_client.labelling.formats.exchange import (
    CLASS,
    FormatError,
    Labels,
    Mask,
    decode,
    fill,
    joined,
    outlines,
    written_whole,
)
from dlo_client.labelling.labels import LabelledInstance, PictureLabel


def write(labels: Labels, out: Path) -> Path:
    """``yolo/labels/NAME.txt`` and ``yolo/dataset.yaml``; the pictures belong into ``yolo/images``."""
    folder = out / "yolo"
    for label in labels():
        with written_whole(folder / "labels" / Path(label.name).with_suffix(".txt")) as file:
            file.writelines(_line(item, label) for item in label.instances)
    with written_whole(folder / "dataset.yaml") as file:
        file.write(f"path: .\ntrain: images\nval: images\nnames:\n  0: {CLASS}\n")
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


def _line(item: LabelledInstance, label: PictureLabel) -> str:
    """Class 0 and the polygon in shares of the picture; nothing for an instance that is hidden altogether."""
    rings = outlines(decode(item.mask_rle))
    if not rings:
        return ""
    shares = joined(rings) / (label.width, label.height)
    return f"0 {' '.join(f'{v:.7f}' for v in shares.ravel())}\n"
