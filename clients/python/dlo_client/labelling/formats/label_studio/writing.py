"""Label Studio predictions: a brush and a vector line for every instance, crossings as key points.

``label_studio.xml`` is the labelling configuration to paste, ``label_studio.json`` the tasks to
import. Coordinates are in percent of the picture, a pixel's center at a half.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dlo_client.contracts import Point
from dlo_client.labelling.formats.exchange import CLASS, Labels, write_list, written_whole
from dlo_client.labelling.formats.label_studio.brush import encode_brush
from dlo_client.labelling.formats.pixels import decode
from dlo_client.labelling.labels import LabelledInstance, PictureLabel

LINE, CROSSING = "centerline", "crossing"
CONFIG = f"""<View>
  <Image name="image" value="$image" zoom="true"/>
  <BrushLabels name="brush" toName="image"><Label value="{CLASS}" background="#ff8c00"/></BrushLabels>
  <VectorLabels name="line" toName="image" skeleton="false" closable="false">
    <Label value="{LINE}" background="#00bcd4"/>
  </VectorLabels>
  <KeyPointLabels name="point" toName="image"><Label value="{CROSSING}" background="#e91e63"/></KeyPointLabels>
</View>
"""
PREFIX = "/data/local-files/?d="


def write(labels: Labels, out: Path) -> Path:
    """The tasks name their pictures for Label Studio's local storage, relative to its root."""
    with written_whole(out / "label_studio.xml") as file:
        file.write(CONFIG)
    with written_whole(out / "label_studio.json") as file:
        write_list(file, (_task(label) for label in labels()))
    return out / "label_studio.json"


def prediction(label: PictureLabel) -> dict[str, Any]:
    """One prediction, as a task holds it."""
    scores = [item.score for item in label.instances if item.score is not None]
    return {
        "model_version": label.method or label.origin,
        "score": min(scores, default=0.0),
        "result": list(_regions(label)),
    }


def _task(label: PictureLabel) -> dict[str, Any]:
    meta = {
        "dlo_name": label.name,
        "sha256": label.sha256,
        "crossings": [c.model_dump(mode="json") for c in label.crossings],
    }
    data = {"image": PREFIX + quote(label.name), "width": label.width, "height": label.height}
    return {"data": data, "meta": meta, "predictions": [prediction(label)]}


def _regions(label: PictureLabel) -> Iterator[dict[str, Any]]:
    common = {
        "to_name": "image",
        "original_width": label.width,
        "original_height": label.height,
        "image_rotation": 0,
    }
    for item in label.instances:
        facts = {"meta": {"width_px": item.width_px, "closed": item.closed}, "score": item.score}
        brush = {
            "format": "rle",
            "rle": encode_brush(decode(item.mask_rle)),
            "brushlabels": [CLASS],
        }
        yield {
            **common,
            **facts,
            "id": f"dlo-{item.id}-mask",
            "from_name": "brush",
            "type": "brushlabels",
            "value": brush,
        }
        if len(item.centerline_xy) >= 2:
            line = {
                "vertices": list(_vertices(item, label)),
                "closed": False,
                "vectorlabels": [LINE],
            }
            yield {
                **common,
                **facts,
                "id": f"dlo-{item.id}-line",
                "from_name": "line",
                "type": "vectorlabels",
                "value": line,
            }
    for crossing in label.crossings:
        (x, y) = _percent(crossing.xy, label.width, label.height)
        point = {"x": x, "y": y, "width": 0.8, "keypointlabels": [CROSSING]}
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
