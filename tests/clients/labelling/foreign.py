"""Small files as labelling tools write them, and a folder of labels to bring them back into."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dlo_client.contracts import Crossing, StrandPosition
from dlo_client.labelling import LabelStore, PictureLabel
from dlo_client.labelling.corrections import CorrectionReport, take_corrections
from dlo_client.labelling.formats import READERS, Imported, Wanted
from dlo_client.labelling.store import Entry

from tests.clients.labelling import drawn

SQUARE = [[10, 10], [30, 10], [30, 20], [10, 20]]
"""200 pixels."""


def written(folder: Path, content: object, name: str = "export") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def read(tool: str, folder: Path, content: object, wanted: Wanted | None = None) -> Imported:
    """What a tool's file with this content holds."""
    return READERS[tool](written(folder, content), wanted or Wanted())


def coco(*pictures: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """A picture of 90 × 70 for each list of annotations: ``0.png``, ``1.png``, …"""
    images = [
        {"id": k, "file_name": f"{k}.png", "width": drawn.WIDTH, "height": drawn.HEIGHT}
        for k in range(len(pictures))
    ]
    annotations = [
        {"id": f"{k}{n}", "image_id": k, "category_id": 1, "segmentation": [flat(SQUARE)]} | given
        for k, all_of_it in enumerate(pictures)
        for n, given in enumerate(all_of_it)
    ]
    categories = [{"id": 1, "name": "dlo"}, {"id": 2, "name": "connector"}]
    return {"images": images, "annotations": annotations, "categories": categories} | more


def flat(points: list[list[float]]) -> list[float]:
    return [value for point in points for value in point]


def cvat(*pictures: str, meta: str = "") -> str:
    """A picture of 90 × 70 for each text of shapes: ``0.png``, ``1.png``, …"""
    images = "".join(
        f'<image id="{k}" name="{k}.png" width="{drawn.WIDTH}" height="{drawn.HEIGHT}">{shapes}</image>'
        for k, shapes in enumerate(pictures)
    )
    return f"<annotations><version>1.1</version>{meta}{images}</annotations>"


def shape(
    tag: str, points: list[list[float]], attributes: dict[str, object] | None = None, **more: object
) -> str:
    facts = "".join(f'<attribute name="{k}">{v}</attribute>' for k, v in (attributes or {}).items())
    given = {"label": "dlo", "points": ";".join(f"{x},{y}" for x, y in points), **more}
    return (
        f"<{tag} {' '.join(f'{k}={json.dumps(str(v))}' for k, v in given.items())}>{facts}</{tag}>"
    )


def task(name: str, *results: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A Label Studio task that somebody submitted."""
    data = {"image": f"/data/local-files/?d={name}", "width": drawn.WIDTH, "height": drawn.HEIGHT}
    return {"data": data, "annotations": [{"result": list(results)}]} | more


def region(kind: str, value: dict[str, Any], label: str = "dlo", **more: Any) -> dict[str, Any]:
    """A region whose points are in percent."""
    size = {"original_width": drawn.WIDTH, "original_height": drawn.HEIGHT, "image_rotation": 0}
    return size | {"id": f"{kind}-x", "type": kind, "value": value | {kind: [label]}} | more


def annotated(file: Path) -> Path:
    """The tasks that we wrote, as they come back when somebody submitted every prediction."""
    tasks = json.loads(file.read_text())
    for each in tasks:
        each["annotations"] = [
            {"id": 1, "was_cancelled": False, "result": each["predictions"][0]["result"]}
        ]
    file.write_text(json.dumps(tasks))
    return file


def store_of(
    folder: Path, *labels: PictureLabel, sha256: dict[str, str] | None = None
) -> LabelStore:
    """A folder that `dlo label` filled with these labels, open for writing."""
    store = LabelStore(folder, write=True)
    for label in labels:
        digest = (sha256 or {}).get(label.name, "")
        store.put(
            Entry(label.name, "done", sha256=digest),
            label.model_copy(update={"sha256": digest or None}),
        )
    return store


def brought_back(folder: Path, imported: Imported, *names: str) -> CorrectionReport:
    with store_of(folder, *(drawn.label(name) for name in names)) as store:
        return take_corrections(store, imported)


def crossing(over: int, under: int) -> dict[str, Any]:
    strands = [StrandPosition(instance=k, u=0.5) for k in (over, under)]
    return Crossing(id=1, xy=(20, 15), over=strands[0], under=strands[1], score=0.9).model_dump(
        mode="json"
    )
