"""The picture and the answer at the top of README.md: `python -m tests.readme` makes both anew."""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dlo_client.contracts import InstancesRequest

from tests.api_examples import ROOT
from workers import stages
from workers.settings import Settings
from workers.stages.outcome import Tools

PAGE = ROOT / "README.md"
PICTURE = ROOT / "docs" / "images" / "instances.jpg"
SOURCE = ROOT / "tests" / "samples" / "busy.jpg"
_BLOCK = re.compile(r"```json\n(.*?)\n```", re.S)
_INSTANCE = ("id", "score", "reasons", "width_px", "length_px", "closed")
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 88]


def answer(tools: Tools) -> tuple[dict[str, Any], bytes]:
    """What the service finds in the picture, and its overlay as PNG."""
    image = {"id": tools.blobs.put(SOURCE.read_bytes())}
    outcome = stages.run(InstancesRequest.model_validate({"image": image}), tools)
    return outcome.result.model_dump(mode="json"), outcome.files["overlay.png"][1]


def block(result: dict[str, Any]) -> str:
    """The first cable, the first crossing and the status, laid out by hand."""
    first, crossing = result["instances"][0], result["crossings"][0]
    head = {k: result[k] for k in ("kind", "width", "height", "method")}
    size = {"size": first["mask_rle"]["size"], "counts": "…"}
    place = {k: crossing[k] for k in ("id", "xy", "score", "existence")}
    strands = {k: crossing[k] for k in ("over", "under")}
    return f"""{{
  {_inner(head)},
  "instances": [
    {{{_inner({k: first[k] for k in _INSTANCE})},
     "centerline_xy": {_line([*first["centerline_xy"][:2], "…"])},
     "endpoints": {_line(first["endpoints"])},
     "mask_rle": {_line(size)}}}, "…"
  ],
  "crossings": [
    {{{_inner(place)},
     {_inner(strands)}}}, "…"
  ],
  "status": {_line(result["status"])}
}}"""


def shown() -> str:
    """The block that is in the page."""
    return _BLOCK.findall(PAGE.read_text())[0]


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _inner(value: dict[str, Any]) -> str:
    return _line(value)[1:-1]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        tools = stages.warm(Settings(data_dir=Path(folder), onnx_threads=1))
        result, overlay = answer(tools)
    PAGE.write_text(PAGE.read_text().replace(shown(), block(result), 1))
    picture = cv2.imdecode(np.frombuffer(overlay, np.uint8), cv2.IMREAD_COLOR)
    PICTURE.write_bytes(cv2.imencode(".jpg", picture, _QUALITY)[1])


if __name__ == "__main__":
    main()
