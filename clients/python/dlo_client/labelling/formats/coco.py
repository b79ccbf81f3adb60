"""COCO instance segmentation. Run lengths lose nothing; polygons are for tools that know nothing else.

Extra fields: of an annotation ``centerline_xy``, ``width_px``, ``closed``, ``score`` and ``instance``; of a picture
``crossings`` (ids as ``instance`` in the annotations).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dlo_client.contracts import Crossing, MaskRLE
from dlo_client.labelling.formats.exchange import (
    CLASS,
    FormatError,
    Imported,
    Labels,
    box,
    decode,
    encode,
    fill,
    mean_width,
    outlines,
    read_json,
    write_list,
    written_whole,
)
from dlo_client.labelling.labels import LabelledInstance, PictureLabel


def write(labels: Labels, out: Path) -> Path:
    """``coco.json`` with run-length masks."""
    return _write(labels, out / "coco.json", polygons=False)


def write_polygons(labels: Labels, out: Path) -> Path:
    """``coco-polygons.json``; a hole is joined to the outline by a cut of no width."""
    return _write(labels, out / "coco-polygons.json", polygons=True)


def read(path: Path) -> Imported:
    """Annotations of one picture that cannot be read cost that picture, not the others. Raises FormatError."""
    data = read_json(path)
    try:
        pictures = {p["id"]: p for p in data["images"]}
        grouped: dict[Any, list[dict[str, Any]]] = {key: [] for key in pictures}
        strays = [a for a in data["annotations"] if a["image_id"] not in pictures]
    except (KeyError, TypeError) as error:
        raise FormatError(f"{path}: no COCO file: {error!r} is missing") from error
    imported = Imported()
    for annotation in data["annotations"]:
        grouped.get(annotation["image_id"], strays).append(annotation)
    if strays:
        ids = sorted({str(a["image_id"]) for a in strays})
        imported.problems[f"image_id {', '.join(ids[:5])}"] = "annotations of a picture that the file does not list"
    for key, picture in pictures.items():
        name = str(picture.get("file_name", key))
        try:
            imported.labels.append(_label(name, picture, grouped[key]))
        except (KeyError, TypeError, ValueError, ValidationError) as error:
            imported.problems[name] = f"cannot be read: {error}"
    return imported


def _write(labels: Labels, file: Path, *, polygons: bool) -> Path:
    with written_whole(file) as out:
        info = {"description": "DLO instance labels", "format": "dlo-label/1"}
        category = {"id": 1, "name": CLASS, "supercategory": CLASS}
        out.write(
            f'{{"info": {json.dumps(info)},\n"licenses": [],\n"categories": [{json.dumps(category)}],\n"images": '
        )
        write_list(out, (_picture(k, label) for k, label in enumerate(labels(), start=1)))
        out.write(',\n"annotations": ')
        write_list(out, _annotations(labels, polygons))
        out.write("}\n")
    return file


def _picture(number: int, label: PictureLabel) -> dict[str, Any]:
    return {
        "id": number,
        "file_name": label.name,
        "width": label.width,
        "height": label.height,
        "crossings": [c.model_dump(mode="json") for c in label.crossings],
    }


def _annotations(labels: Labels, polygons: bool) -> Iterator[dict[str, Any]]:
    number = 0
    for image_id, label in enumerate(labels(), start=1):
        for item in label.instances:
            number += 1
            bounds, area = box(item.mask_rle)
            segmentation: Any = {"size": list(item.mask_rle.size), "counts": item.mask_rle.counts}
            if polygons:
                segmentation = [ring.ravel().tolist() for ring in outlines(decode(item.mask_rle))]
            yield {
                "id": number, "image_id": image_id, "category_id": 1, "iscrowd": 0, "bbox": bounds, "area": area,
                "segmentation": segmentation, "instance": item.id, "score": item.score,
                "centerline_xy": item.centerline_xy, "width_px": item.width_px, "closed": item.closed,
            }  # fmt: skip


def _label(name: str, picture: dict[str, Any], annotations: list[dict[str, Any]]) -> PictureLabel:
    height, width = int(picture["height"]), int(picture["width"])
    return PictureLabel(
        name=name,
        width=width,
        height=height,
        origin="corrected",
        instances=[_instance(k, a, height, width) for k, a in enumerate(annotations, start=1)],
        crossings=[Crossing.model_validate(c) for c in picture.get("crossings", [])],
    )


def _instance(number: int, annotation: dict[str, Any], height: int, width: int) -> LabelledInstance:
    rle = _mask(annotation["segmentation"], height, width)
    return LabelledInstance(
        id=int(annotation.get("instance") or number),
        centerline_xy=annotation.get("centerline_xy") or [],
        width_px=annotation.get("width_px") or mean_width(decode(rle)),
        closed=bool(annotation.get("closed", False)),
        mask_rle=rle,
    )


def _mask(segmentation: Any, height: int, width: int) -> MaskRLE:
    """Compressed or plain run lengths, or polygons."""
    if isinstance(segmentation, list):
        return encode(fill([np.asarray(ring, float).reshape(-1, 2) for ring in segmentation], height, width))
    counts, size = segmentation["counts"], segmentation["size"]
    if list(size) != [height, width]:
        raise ValueError(f"a mask of {size[1]}×{size[0]} for a picture of {width}×{height}")
    if isinstance(counts, list):
        runs = np.asarray(counts, np.int64)
        if runs.sum() != height * width or runs.min(initial=0) < 0:
            raise ValueError("the run lengths do not fill the picture")
        return encode(np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(width, height).T)
    rle = MaskRLE(size=(height, width), counts=counts)
    _check(rle)
    return rle


def _check(rle: MaskRLE) -> None:
    """The library trusts its input: a string whose runs do not fill the picture would be read past its end."""
    if sum(_runs(rle.counts)) != rle.size[0] * rle.size[1]:
        raise ValueError("the run lengths do not fill the picture")


def _runs(counts: str) -> list[int]:
    """The runs of COCO's compressed string: 5 bits a character, bit 6 for more, from the fourth run on differences."""
    runs: list[int] = []
    value = shift = 0
    for character in counts.encode():
        code = character - 48
        if not 0 <= code < 64 or shift > 30:
            raise ValueError("no run-length string")
        value |= (code & 0x1F) << shift
        shift += 5
        if not code & 0x20:
            value -= (code & 0x10) << (shift - 4)
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
            value = shift = 0
            if runs[-1] < 0:
                raise ValueError("a negative run length")
    if shift:
        raise ValueError("the run-length string is cut short")
    return runs
