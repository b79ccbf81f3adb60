"""Label Studio predictions: a brush and a vector line for every instance, crossings as key points.

``label_studio.xml`` is the labelling configuration to paste, ``label_studio.json`` the tasks to import. Exported
annotations (JSON, not JSON-MIN) are read back. Coordinates are in percent of the picture, a pixel's center at a half.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, quote, unquote, urlsplit

import numpy as np
from pydantic import ValidationError

from dlo_client.contracts import Crossing, Point
from dlo_client.labelling.formats.brush import decode_brush, encode_brush
from dlo_client.labelling.formats.exchange import (
    CLASS,
    FormatError,
    Imported,
    Labels,
    decode,
    fill,
    instance_of,
    read_json,
    write_list,
    written_whole,
)
from dlo_client.labelling.labels import LabelledInstance, PictureLabel

CONFIG = f"""<View>
  <Image name="image" value="$image" zoom="true"/>
  <BrushLabels name="brush" toName="image"><Label value="{CLASS}" background="#ff8c00"/></BrushLabels>
  <VectorLabels name="line" toName="image" skeleton="false" closable="false">
    <Label value="centerline" background="#00bcd4"/>
  </VectorLabels>
  <KeyPointLabels name="point" toName="image"><Label value="crossing" background="#e91e63"/></KeyPointLabels>
</View>
"""
_PREFIX = "/data/local-files/?d="
_REGION = re.compile(r"^dlo-(\d+)-(mask|line)$")


def write(labels: Labels, out: Path) -> Path:
    """The tasks name their pictures for Label Studio's local storage, relative to its root."""
    with written_whole(out / "label_studio.xml") as file:
        file.write(CONFIG)
    with written_whole(out / "label_studio.json") as file:
        write_list(file, (_task(label) for label in labels()))
    return out / "label_studio.json"


def read(path: Path) -> Imported:
    """Of each task the latest annotation, else its prediction. Raises FormatError."""
    tasks = read_json(path)
    if not isinstance(tasks, list):
        raise FormatError(f"{path}: no list of tasks")
    imported = Imported()
    for number, task in enumerate(tasks, start=1):
        place = f"task {number}"
        try:
            place = _name(task)
            imported.labels.append(_label(place, task))
        except (KeyError, IndexError, TypeError, ValueError, ValidationError) as error:
            imported.problems[place] = f"cannot be read: {error!r}"
    return imported


def _task(label: PictureLabel) -> dict[str, Any]:
    scores = [item.score for item in label.instances if item.score is not None]
    prediction = {
        "model_version": label.method or label.origin,
        "score": min(scores, default=0.0),
        "result": list(_regions(label)),
    }
    meta = {"dlo_name": label.name, "crossings": [c.model_dump(mode="json") for c in label.crossings]}
    data = {"image": _PREFIX + quote(label.name), "width": label.width, "height": label.height}
    return {"data": data, "meta": meta, "predictions": [prediction]}


def _regions(label: PictureLabel) -> Iterator[dict[str, Any]]:
    common = {
        "to_name": "image", "original_width": label.width, "original_height": label.height, "image_rotation": 0,
    }  # fmt: skip
    for item in label.instances:
        facts = {"meta": {"width_px": item.width_px, "closed": item.closed}, "score": item.score}
        brush = {"format": "rle", "rle": encode_brush(decode(item.mask_rle)), "brushlabels": [CLASS]}
        yield {
            **common,
            **facts,
            "id": f"dlo-{item.id}-mask",
            "from_name": "brush",
            "type": "brushlabels",
            "value": brush,
        }
        if len(item.centerline_xy) >= 2:
            line = {"vertices": list(_vertices(item, label)), "closed": False, "vectorlabels": ["centerline"]}
            yield {**common, **facts, "id": f"dlo-{item.id}-line", "from_name": "line", "type": "vectorlabels",
                   "value": line}  # fmt: skip
    for crossing in label.crossings:
        (x, y) = _percent(crossing.xy, label.width, label.height)
        point = {"x": x, "y": y, "width": 0.8, "keypointlabels": ["crossing"]}
        yield {
            **common,
            "id": f"crossing-{crossing.id}",
            "from_name": "point",
            "type": "keypointlabels",
            "value": point,
        }


def _vertices(item: LabelledInstance, label: PictureLabel) -> Iterator[dict[str, Any]]:
    previous = None
    for k, xy in enumerate(item.centerline_xy):
        x, y = _percent(xy, label.width, label.height)
        yield {"id": f"{item.id}-{k}", "x": x, "y": y, "prevPointId": previous, "isBezier": False}
        previous = f"{item.id}-{k}"


def _percent(xy: Point, width: int, height: int) -> Point:
    return (xy[0] + 0.5) / width * 100, (xy[1] + 0.5) / height * 100


def _pixels(x: float, y: float, width: int, height: int) -> Point:
    return round(x / 100 * width - 0.5, 4), round(y / 100 * height - 0.5, 4)


def _name(task: dict[str, Any]) -> str:
    """The picture's name as it was written; else what the address of the picture says."""
    given = (task.get("meta") or {}).get("dlo_name")
    if given:
        return str(given)
    address = urlsplit(str(task["data"]["image"]))
    return parse_qs(address.query)["d"][0] if "d=" in address.query else unquote(address.path).lstrip("/")


def _label(name: str, task: dict[str, Any]) -> PictureLabel:
    kept = [a for a in task.get("annotations") or [] if not a.get("was_cancelled")]
    latest = max(kept, key=lambda a: str(a.get("updated_at", ""))) if kept else task["predictions"][0]
    results = latest["result"]
    sizes = [(int(r["original_width"]), int(r["original_height"])) for r in results if "original_width" in r]
    width, height = sizes[0] if sizes else (int(task["data"]["width"]), int(task["data"]["height"]))
    groups = _grouped(results)
    seen = {str(r.get("id")) for r in results if r["type"] == "keypointlabels"}
    crossings = [Crossing.model_validate(c) for c in (task.get("meta") or {}).get("crossings", [])]
    return PictureLabel(
        name=name,
        width=width,
        height=height,
        origin="corrected",
        instances=[_instance(number, regions, height, width) for number, regions in groups.items()],
        crossings=[c for c in crossings if f"crossing-{c.id}" in seen],
    )


def _grouped(results: list[dict[str, Any]]) -> dict[int, list[dict[str, Any]]]:
    """Regions by instance: ours by their id; what a person adds is a DLO of its own."""
    groups: dict[int, list[dict[str, Any]]] = {}
    added = []
    for region in results:
        if region["type"] not in ("brushlabels", "vectorlabels", "polygonlabels"):
            continue
        ours = _REGION.match(str(region.get("id", "")))
        if ours:
            groups.setdefault(int(ours[1]), []).append(region)
        else:
            added.append(region)
    for region in added:
        groups[max(groups, default=0) + 1] = [region]
    return groups


def _instance(number: int, regions: list[dict[str, Any]], height: int, width: int) -> LabelledInstance:
    mask = np.zeros((height, width), bool)
    line: list[Point] = []
    facts: dict[str, Any] = {}
    for region in regions:
        value = region["value"]
        facts |= region.get("meta") or {}
        if region["type"] == "brushlabels":
            mask |= decode_brush(value["rle"], height, width)
        elif region["type"] == "polygonlabels":
            mask |= fill([np.array(value["points"], float) / 100 * (width, height)], height, width)
        else:
            line = [_pixels(v["x"], v["y"], width, height) for v in value["vertices"]]
    return instance_of(number, mask, line, facts.get("width_px"), bool(facts.get("closed", False)))
