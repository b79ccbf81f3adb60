"""Indexed PNG: a pixel's value is the instance's id, 0 is background. At most 255 instances a
picture."""

from __future__ import annotations

import colorsys
import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from dlo_client.labelling.formats.exchange import FormatError, Labels
from dlo_client.labelling.formats.names import stem, stem_and_suffix, told_apart
from dlo_client.labelling.formats.pixels import decode
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.store import write_whole


def write(labels: Labels, out: Path) -> Path:
    """``masks/NAME.png``; where two pictures differ by their suffix alone,
    ``masks/NAME_SUFFIX.png``."""
    folder = out / "masks"
    files = told_apart((label.name for label in labels()), stem, stem_and_suffix)
    for label in labels():
        write_whole(folder / f"{files[label.name]}.png", encode_png(ids_of(label)))
    return folder


def ids_of(label: PictureLabel) -> NDArray[np.uint8]:
    """(H, W) ids; where masks overlap the later instance is on top. Raises FormatError above id
    255."""
    ids = np.zeros((label.height, label.width), np.uint8)
    for item in label.instances:
        if item.id > 255:
            raise FormatError(f"{label.name}: instance {item.id} does not fit a PNG of 256 values")
        ids[decode(item.mask_rle)] = item.id
    return ids


def encode_png(ids: NDArray[np.uint8]) -> bytes:
    picture = Image.fromarray(ids, "L")
    picture.putpalette(_palette())
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def read_png(content: bytes) -> NDArray[np.uint8]:
    """(H, W) ids."""
    return np.asarray(Image.open(io.BytesIO(content)), np.uint8)


def _palette() -> bytes:
    """Black, then hues a golden section apart."""
    colors = [(0.0, 0.0, 0.0)] + [
        colorsys.hsv_to_rgb(k * 0.61803398875 % 1.0, 0.85, 1.0) for k in range(255)
    ]
    return bytes(round(255 * channel) for color in colors for channel in color)
