"""A page on which the ranges of a chroma-key screen are picked by eye; it needs no server and no
network."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from models.synthesis.chroma_ranges import ScreenRanges

_TEMPLATE = Path(__file__).with_name("chroma_page.html")
_LONGEST_PX = 480


def page(pictures: Sequence[NDArray[np.uint8]], ranges: ScreenRanges) -> str:
    """The page for some (H, W, 3) RGB pictures of a recording; it begins with ``ranges``."""
    start = {"hue": ranges.hue_deg, "saturation": ranges.saturation, "value": ranges.value}
    data = {"pictures": [_address(picture) for picture in pictures], "ranges": start}
    # "</" would end the script that holds the data.
    return _TEMPLATE.read_text().replace("{{data}}", json.dumps(data).replace("</", "<\\/"))


def _address(picture: NDArray[np.uint8]) -> str:
    """A small copy as a data address."""
    factor = min(1.0, _LONGEST_PX / max(picture.shape[:2]))
    size = max(round(picture.shape[1] * factor), 1), max(round(picture.shape[0] * factor), 1)
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    written = cv2.imencode(".png", small[:, :, ::-1])[1].tobytes()
    return "data:image/png;base64," + base64.b64encode(written).decode()
