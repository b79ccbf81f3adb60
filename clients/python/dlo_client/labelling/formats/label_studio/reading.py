"""Label Studio's export (JSON, not JSON-MIN) back into labels.

Of each task the annotation that was marked as ground truth, else the latest, counts; predictions do
not: a task that was skipped or that nobody opened is not annotated. Results with one id are one
region, our two regions of an instance (``dlo-3-mask``, ``dlo-3-line``) one DLO. Regions that were
drawn while the picture was turned are turned back.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np

from dlo_client.labelling.formats.drawn import number, pairs, yes
from dlo_client.labelling.formats.exchange import FormatError, Imported, Refused, read_json
from dlo_client.labelling.formats.gate import UNSAID, Canvas, Drawn, Wanted, no_outline, settle
from dlo_client.labelling.formats.label_studio.brush import decode_brush
from dlo_client.labelling.formats.label_studio.writing import CROSSING, LINE
from dlo_client.labelling.formats.pixels import Ring
from dlo_client.labelling.labels import PictureLabel

_Record = dict[str, Any]
_OURS = re.compile(r"^dlo-(\d{1,9})-(mask|line)$")
_UPLOADED = re.compile(r"^[0-9a-f]{8}-(?=.)")
_KINDS = {
    "rectangle": "rectangle",
    "ellipse": "ellipse",
    "keypoint": "point",
    "bitmask": "bitmask",
    "video": "video box",
}


def read(path: Path, wanted: Wanted = Wanted()) -> Imported:  # noqa: B008
    """A task that cannot be read costs that picture, not the others. Raises FormatError."""
    tasks = read_json(path)
    if not isinstance(tasks, list):
        raise FormatError(f"{path}: no list of tasks")
    imported = Imported()
    for place, task in enumerate(tasks, start=1):
        name = f"task {place}"
        with imported.one_picture(name):
            if not isinstance(task, dict) or not isinstance(task.get("data"), dict):
                raise Refused("no task with `data`: export as JSON, not as JSON-MIN")
            name = _name(task)
        if name == f"task {place}":
            continue
        with imported.one_picture(name):
            label = _label(name, task, wanted, imported)
            if label is not None:
                imported.labels.append(label)
    return settle(imported, wanted)


def _name(task: _Record) -> str:
    """The picture's name as it was written; else what the address of the picture states."""
    meta = task.get("meta")
    given = meta.get("dlo_name") if isinstance(meta, dict) else None
    if given:
        return str(given)
    values = task["data"]
    image = values.get("image") or next(
        (v for v in values.values() if isinstance(v, str) and "." in v), ""
    )
    if not image:
        raise Refused("names no picture")
    address = urlsplit(str(image))
    listed = parse_qs(address.query).get("d")
    path = PurePosixPath(listed[0] if listed else unquote(address.path).lstrip("/"))
    return (
        str(path.with_name(_UPLOADED.sub("", path.name))) if "upload" in path.parts else str(path)
    )


def _label(name: str, task: _Record, wanted: Wanted, imported: Imported) -> PictureLabel | None:
    """None of a task in which there is nobody's work."""
    given = task.get("annotations") or task.get("completions") or []
    kept = [a for a in given if isinstance(a, dict) and not a.get("was_cancelled")]
    if not kept:
        imported.not_annotated[name] = "skipped" if given else "never annotated"
        return None
    chosen = max(
        kept,
        key=lambda a: (
            bool(a.get("ground_truth")),
            str(a.get("updated_at") or a.get("created_at") or ""),
        ),
    )
    if len(kept) > 1:
        imported.note("several annotations, the latest taken", name)
    results = [r for r in chosen.get("result") or [] if isinstance(r, dict)]
    canvas = Canvas(name, _size(name, results, task["data"], wanted), wanted, imported)
    given_meta = task.get("meta")
    meta: _Record = given_meta if isinstance(given_meta, dict) else {}
    crossings = {
        f"crossing-{c.get('id')}": c for c in meta.get("crossings") or [] if isinstance(c, dict)
    }
    groups: dict[str, list[_Record]] = {}
    for key, region in _regions(results).items():
        if _is_cable(key, region, crossings, canvas, wanted):
            ours = _OURS.match(key)
            groups.setdefault(ours[1] if ours else f"region {key}", []).append(region)
    for key, regions in groups.items():
        canvas.add(_drawn(key, regions, canvas))
    return canvas.label(meta.get("sha256"))


def _size(
    name: str, results: list[_Record], data: _Record, wanted: Wanted
) -> tuple[object, object]:
    sizes = {
        (r["original_width"], r.get("original_height"))
        for r in results
        if r.get("original_width") is not None
    }
    if len(sizes) > 1:
        raise Refused("its regions are of pictures of different sizes")
    if sizes:
        return sizes.pop()
    return wanted.sizes.get(name, (data.get("width"), data.get("height")))


def _regions(results: list[_Record]) -> dict[str, _Record]:
    """Results by their id. Those of one id say different things of one region: its shape, its
    label, a choice."""
    regions: dict[str, _Record] = {}
    for place, result in enumerate(results):
        key = str(result.get("id") or f"result {place + 1}")[:80]
        value = result.get("value") if isinstance(result.get("value"), dict) else {}
        region = regions.setdefault(key, {"value": {}, "types": [], "meta": {}})
        region["value"] = region["value"] | value
        region["types"].append(str(result.get("type")))
        region["turned"] = result.get("image_rotation") or region.get("turned") or 0
        region["meta"] |= result.get("meta") if isinstance(result.get("meta"), dict) else {}
    return regions


def _is_cable(
    key: str, region: _Record, crossings: dict[str, _Record], canvas: Canvas, wanted: Wanted
) -> bool:
    """Whether a region is to become an instance. What it is otherwise is dealt with here."""
    value = region["value"]
    called = [
        str(c) for k, v in value.items() if k.endswith("labels") and isinstance(v, list) for c in v
    ]
    kind = _kind(region)
    if kind is None:
        canvas.leave_out(f"result of type '{region['types'][0]}'")
    elif kind == "point" and CROSSING in called:
        _cross(region, crossings.get(key), canvas)
    elif any(wanted.takes(c) for c in called) or (kind == "line" and LINE in called):
        return True
    elif called:
        canvas.other_class(", ".join(called))
    else:
        canvas.leave_out(f"{kind} without a label")
    return False


def _kind(region: _Record) -> str | None:
    """What its shape is; None where it has none."""
    value = region["value"]
    if "rle" in value:
        return "brush"
    if "vertices" in value:
        return "line"
    if "points" in value:
        return "polygon"
    named = next((_KINDS[k] for t in region["types"] for k in _KINDS if t.startswith(k)), None)
    if named is None and "x" in value:
        named = "ellipse" if "radiusX" in value else "rectangle" if "height" in value else "point"
    return named


def _drawn(key: str, regions: list[_Record], canvas: Canvas) -> Drawn:
    facts: _Record = {}
    for region in regions:
        facts |= region["meta"]
    drawn = Drawn(
        f"region dlo-{key}" if key.isdecimal() else key,
        number=key,
        width_px=facts.get("width_px"),
        closed=facts.get("closed"),
    )
    for region in regions:
        value, kind = region["value"], _kind(region)
        turned = _turned(region, canvas)
        if kind == "brush":
            if turned:
                raise Refused(
                    f"{drawn.place} is a brush on a turned picture: draw it with the picture upright"
                )
            drawn.masks.append(decode_brush(value["rle"], canvas.height, canvas.width))
        elif kind == "line":
            drawn.lines.append(
                _upright(_vertices(value, drawn.place, canvas), turned, canvas) - 0.5
            )
            drawn.closed = yes(facts.get("closed")) or yes(value.get("closed"))
        elif kind == "polygon" and value.get("closed") is False:
            drawn.lines.append(_upright(pairs(value["points"], drawn.place), turned, canvas) - 0.5)
        elif kind == "polygon":
            drawn.rings.append(_upright(pairs(value["points"], drawn.place), turned, canvas))
        else:
            raise no_outline(str(kind))
    return drawn


def _turned(region: _Record, canvas: Canvas) -> int:
    """By how many quarter turns to the right the picture was shown."""
    turned = number(region["turned"], "image_rotation")
    if turned % 90:
        raise Refused(f"image_rotation is {turned:g}, not a multiple of 90")
    if turned % 360:
        canvas.note("drawn on a turned picture, turned back")
    return int(turned // 90) % 4


def _upright(percent: Ring, turned: int, canvas: Canvas) -> Ring:
    """Percent of the picture as it was shown, to continuous pixels of the upright one."""
    x, y = percent.T
    x, y = ((x, y), (y, 100 - x), (100 - x, 100 - y), (100 - y, x))[turned]
    return np.stack([x / 100 * canvas.width, y / 100 * canvas.height], 1)


def _vertices(value: _Record, place: str, canvas: Canvas) -> Ring:
    """In the order of the list, which a line that does not branch keeps."""
    vertices = value["vertices"]
    if not isinstance(vertices, list) or not all(isinstance(v, dict) for v in vertices):
        raise Refused(f"{place} has no list of vertices")
    for before, after in pairwise(vertices):
        if after.get("prevPointId") is not None and after["prevPointId"] != before.get("id"):
            raise Refused(f"{place} is a line that branches or is cut")
    if any(v.get("isBezier") for v in vertices):
        canvas.note("bends of a Bézier line, drawn straight")
    return pairs([[v.get("x"), v.get("y")] for v in vertices], place).reshape(-1, 2)


def _cross(region: _Record, known: _Record | None, canvas: Canvas) -> None:
    """A crossing that was written out by us, where it is by now; a new one does not say which
    cables."""
    if known is None:
        canvas.note(UNSAID)
        return
    value = region["value"]
    xy = (
        _upright(
            pairs([[value.get("x"), value.get("y")]], "a crossing"), _turned(region, canvas), canvas
        )
        - 0.5
    )
    canvas.cross(known | {"xy": np.round(xy[0], 4).tolist()})
