"""COCO instance segmentation. Run lengths lose nothing; polygons are for tools that know nothing
else.

Extra fields: of an annotation ``centerline_xy``, ``width_px``, ``closed``, ``score`` and
``instance``; of a picture ``sha256`` and ``crossings`` (ids as ``instance`` in the annotations).
The corrector page adds ``confirmed``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dlo_client.labelling.formats.drawn import pairs, yes
from dlo_client.labelling.formats.exchange import (
    CLASS,
    FormatError,
    Imported,
    Labels,
    Refused,
    read_json,
    write_list,
    written_whole,
)
from dlo_client.labelling.formats.gate import Canvas, Drawn, Wanted, settle
from dlo_client.labelling.formats.pixels import box, decode, outlines
from dlo_client.labelling.formats.run_lengths import mask_of_runs
from dlo_client.labelling.labels import PictureLabel

_Record = dict[str, Any]


def write(labels: Labels, out: Path) -> Path:
    """``coco.json`` with run-length masks."""
    return _write(labels, out / "coco.json", polygons=False)


def write_polygons(labels: Labels, out: Path) -> Path:
    """``coco-polygons.json``; a hole is joined to the outline by a cut of no width."""
    return _write(labels, out / "coco-polygons.json", polygons=True)


def read(path: Path, wanted: Wanted = Wanted()) -> Imported:  # noqa: B008
    """Annotations of one picture that cannot be read cost that picture, not the others. Ids may be
    numbers or their text. Raises FormatError."""
    data = read_json(path)
    if not isinstance(data, dict) or not all(
        isinstance(data.get(key), list) for key in ("images", "annotations")
    ):
        raise FormatError(f"{path}: no COCO file: it has no lists `images` and `annotations`")
    imported = Imported()
    pictures = _pictures(path, data["images"], imported)
    grouped, strays = _grouped(data["annotations"], pictures)
    if strays:
        imported.refuse(
            f"image_id {', '.join(sorted(strays)[:5])}",
            "annotations of a picture that the file does not list",
        )
    classes = _classes(data.get("categories"))
    for key, picture in pictures.items():
        name = str(picture.get("file_name", key))
        if picture.get("confirmed") is False:
            imported.not_annotated[name] = "nobody confirmed it"
            continue
        with imported.one_picture(name):
            if strays and not grouped[key]:
                raise Refused(
                    "has no annotation, and the file has some of pictures that it does not list"
                )
            imported.labels.append(_label(name, picture, grouped[key], classes, wanted, imported))
    return settle(imported, wanted)


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


def _picture(number: int, label: PictureLabel) -> _Record:
    return {
        "id": number,
        "file_name": label.name,
        "width": label.width,
        "height": label.height,
        "sha256": label.sha256,
        "crossings": [c.model_dump(mode="json") for c in label.crossings],
    }


def _annotations(labels: Labels, polygons: bool) -> Iterator[_Record]:
    number = 0
    for image_id, label in enumerate(labels(), start=1):
        for item in label.instances:
            number += 1
            bounds, area = box(item.mask_rle)
            segmentation: Any = {"size": list(item.mask_rle.size), "counts": item.mask_rle.counts}
            if polygons:
                segmentation = [ring.ravel().tolist() for ring in outlines(decode(item.mask_rle))]
            yield {
                "id": number,
                "image_id": image_id,
                "category_id": 1,
                "iscrowd": 0,
                "bbox": bounds,
                "area": area,
                "segmentation": segmentation,
                "instance": item.id,
                "score": item.score,
                "centerline_xy": item.centerline_xy,
                "width_px": item.width_px,
                "closed": item.closed,
            }


def _key(value: object) -> str:
    """Ids are compared as text: 1, "1" and 1.0 are the same."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    text = str(value).strip()
    return text.lstrip("0") or "0" if text.isdecimal() else text


def _pictures(path: Path, images: list[Any], imported: Imported) -> dict[str, _Record]:
    pictures: dict[str, _Record] = {}
    for place, image in enumerate(images, start=1):
        if not isinstance(image, dict) or image.get("id") is None:
            imported.refuse(f"image {place} of the file", "has no id")
        elif _key(image["id"]) in pictures:
            raise FormatError(f"{path}: two pictures have the id {_key(image['id'])[:40]}")
        else:
            pictures[_key(image["id"])] = image
    return pictures


def _grouped(
    annotations: list[Any], pictures: dict[str, _Record]
) -> tuple[dict[str, list[_Record]], set[str]]:
    """Annotations by picture, and the ids of pictures that are not there."""
    grouped: dict[str, list[_Record]] = {key: [] for key in pictures}
    strays = set()
    for annotation in annotations:
        key = _key(annotation.get("image_id")) if isinstance(annotation, dict) else "none"
        if key in grouped:
            grouped[key].append(annotation)
        else:
            strays.add(key[:40])
    return grouped, strays


def _classes(categories: object) -> dict[str, str]:
    listed = categories if isinstance(categories, list) else []
    return {
        _key(c["id"]): str(c["name"])
        for c in listed
        if isinstance(c, dict) and "id" in c and "name" in c
    }


def _label(
    name: str,
    picture: _Record,
    annotations: list[_Record],
    classes: dict[str, str],
    wanted: Wanted,
    imported: Imported,
) -> PictureLabel:
    canvas = Canvas(name, (picture.get("width"), picture.get("height")), wanted, imported)
    for annotation in annotations:
        category = _key(annotation.get("category_id"))
        called = classes.get(category, f"category_id {category}")
        if not wanted.takes(called):
            canvas.other_class(called)
        elif yes(annotation.get("iscrowd")):
            canvas.leave_out("iscrowd region")
        else:
            canvas.add(_drawn(annotation, canvas))
    crossings = picture.get("crossings") or []
    for crossing in crossings if isinstance(crossings, list) else [crossings]:
        canvas.cross(crossing)
    return canvas.label(picture.get("sha256"))


def _drawn(annotation: _Record, canvas: Canvas) -> Drawn:
    drawn = Drawn(
        place=f"annotation {_key(annotation.get('id'))[:40]}",
        number=annotation.get("instance"),
        width_px=annotation.get("width_px"),
        closed=annotation.get("closed"),
    )
    line = annotation.get("centerline_xy")
    if line:
        drawn.lines.append(pairs(line, drawn.place))
    segmentation = annotation.get("segmentation")
    if isinstance(segmentation, dict):
        drawn.masks.append(_mask(segmentation, canvas))
    elif isinstance(segmentation, list) and segmentation:
        rings = segmentation if isinstance(segmentation[0], list) else [segmentation]
        drawn.rings += [pairs(ring, drawn.place) for ring in rings]
    elif not line:
        raise Refused(f"{drawn.place} has neither a segmentation nor a centerline")
    return drawn


def _mask(segmentation: _Record, canvas: Canvas) -> Any:
    """Compressed or plain run lengths."""
    if list(segmentation.get("size") or []) != [canvas.height, canvas.width]:
        size = segmentation.get("size")
        raise Refused(
            f"a mask of the size {str(size)[:40]} for a picture of {canvas.width}×{canvas.height}"
        )
    return mask_of_runs(segmentation.get("counts"), canvas.height, canvas.width)
