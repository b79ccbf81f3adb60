"""CVAT for images 1.1 (XML): a mask and a polyline for every instance, tied by ``group_id``; crossings as points.

CVAT's coordinates are continuous: the first pixel reaches from 0 to 1, so a pixel's center is at a half.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from dlo_client.contracts import Crossing, Point, StrandPosition
from dlo_client.labelling.formats.exchange import (
    CLASS,
    FormatError,
    Imported,
    Labels,
    Mask,
    decode,
    fill,
    instance_of,
    written_whole,
)
from dlo_client.labelling.labels import LabelledInstance, PictureLabel

_CENTER = 0.5
_ATTRIBUTES = {"dlo": ("width_px", "closed", "score"), "crossing": ("over", "over_u", "under", "under_u", "score")}
_FORBIDDEN = re.compile(rb"<!(DOCTYPE|ENTITY)", re.IGNORECASE)


def write(labels: Labels, out: Path) -> Path:
    """``cvat.xml``; its job needs the labels that ``<meta>`` lists: ``dlo`` and ``crossing``."""
    file = out / "cvat.xml"
    with written_whole(file) as xml:
        xml.write(f'<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n{_meta()}\n')
        for number, label in enumerate(labels()):
            size = f'width="{label.width}" height="{label.height}"'
            xml.write(f'<image id="{number}" name={quoteattr(label.name)} {size}>\n')
            xml.writelines(_shapes(label))
            xml.write("</image>\n")
        xml.write("</annotations>\n")
    return file


def read(path: Path) -> Imported:
    """Raises FormatError for what is no CVAT file; entities are refused."""
    try:
        content = path.read_bytes()
        if _FORBIDDEN.search(content):
            raise FormatError(f"{path}: declares entities")
        root = ET.fromstring(content)
    except (OSError, ET.ParseError) as error:
        raise FormatError(f"{path}: {error}") from error
    if root.tag != "annotations":
        raise FormatError(f"{path}: no <annotations>")
    imported = Imported()
    for image in root.iter("image"):
        name = image.get("name", "")
        try:
            imported.labels.append(_label(name, image))
        except (KeyError, ValueError, TypeError) as error:
            imported.problems[name or "an image without a name"] = f"cannot be read: {error}"
    return imported


def _meta() -> str:
    labels = []
    for name, attributes in _ATTRIBUTES.items():
        listed = "".join(
            f"<attribute><name>{a}</name><mutable>False</mutable><input_type>text</input_type>"
            f"<default_value></default_value><values></values></attribute>"
            for a in attributes
        )
        labels.append(f"<label><name>{name}</name><type>any</type><attributes>{listed}</attributes></label>")
    return f"<meta><job><labels>{''.join(labels)}</labels></job></meta>"


def _shapes(label: PictureLabel) -> Iterator[str]:
    for z, item in enumerate(label.instances):
        common = f'label="{CLASS}" source="auto" occluded="0" z_order="{z}" group_id="{item.id}"'
        mask = decode(item.mask_rle)
        facts = {"width_px": item.width_px, "closed": item.closed, "score": item.score}
        if mask.any():
            yield f"<mask {common} {_mask_attributes(mask)}>{_attributes(facts)}</mask>\n"
        if len(item.centerline_xy) >= 2:
            yield f'<polyline {common} points="{_points(item.centerline_xy)}">{_attributes(facts)}</polyline>\n'
    for crossing in label.crossings:
        facts = {
            "over": crossing.over.instance, "over_u": crossing.over.u, "under": crossing.under.instance,
            "under_u": crossing.under.u, "score": crossing.score,
        }  # fmt: skip
        common = 'label="crossing" source="auto" occluded="0" z_order="0"'
        yield f'<points {common} points="{_points([crossing.xy])}">{_attributes(facts)}</points>\n'


def _mask_attributes(mask: Mask) -> str:
    """Run lengths row by row within the bounding box, starting with background."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    top, left = int(rows[0]), int(columns[0])
    cut = mask[top : rows[-1] + 1, left : columns[-1] + 1]
    flat = np.concatenate(([False], cut.ravel(), [not cut.ravel()[-1]]))
    runs = np.diff(np.concatenate(([0], np.flatnonzero(np.diff(flat)))))
    text = ", ".join(map(str, runs.tolist()))
    return f'rle="{text}" left="{left}" top="{top}" width="{cut.shape[1]}" height="{cut.shape[0]}"'


def _attributes(facts: Mapping[str, object]) -> str:
    given = {name: value for name, value in facts.items() if value is not None}
    return "".join(f'<attribute name="{name}">{value}</attribute>' for name, value in given.items())


def _points(points_xy: list[Point]) -> str:
    return ";".join(f"{x + _CENTER:.2f},{y + _CENTER:.2f}" for x, y in points_xy)


def _label(name: str, image: ET.Element) -> PictureLabel:
    width, height = int(image.attrib["width"]), int(image.attrib["height"])
    groups: dict[str, list[ET.Element]] = {}
    for k, shape in enumerate(s for s in image if s.get("label") != "crossing"):
        # Shapes that a person adds have group 0: each is a DLO of its own.
        group = shape.get("group_id") or "0"
        groups.setdefault(group if group != "0" else f"new {k}", []).append(shape)
    used = {int(g) for g in groups if g.isdecimal()}
    fresh = (n for n in range(1, len(groups) + max(used, default=0) + 2) if n not in used)
    instances = []
    for group, shapes in groups.items():
        number = int(group) if group.isdecimal() else next(fresh)
        instances.append(_instance(number, shapes, height, width))
    crossings = [_crossing(k, s) for k, s in enumerate(image.iterfind("points[@label='crossing']"), start=1)]
    return PictureLabel(
        name=name, width=width, height=height, instances=instances, crossings=crossings, origin="corrected"
    )


def _instance(number: int, shapes: list[ET.Element], height: int, width: int) -> LabelledInstance:
    """The union of the masks and polygons; with a polyline alone, a stroke of its width."""
    facts = {a.get("name"): a.text for shape in shapes for a in shape.iterfind("attribute") if a.text}
    mask = np.zeros((height, width), bool)
    line: list[Point] = []
    for shape in shapes:
        if shape.tag == "mask":
            mask |= _mask(shape, height, width)
        elif shape.tag == "polygon":
            mask |= fill([np.array(_read_points(shape, 0.0))], height, width)
        elif shape.tag == "polyline":
            line = _read_points(shape, _CENTER)
    known = float(facts["width_px"]) if "width_px" in facts else None
    return instance_of(number, mask, line, known, str(facts.get("closed", "")).lower() == "true")


def _mask(shape: ET.Element, height: int, width: int) -> Mask:
    left, top, w, h = (int(float(shape.attrib[key])) for key in ("left", "top", "width", "height"))
    runs = np.array([int(v) for v in shape.attrib["rle"].split(",")], np.int64)
    if runs.sum() != w * h or runs.min(initial=0) < 0 or min(left, top) < 0 or left + w > width or top + h > height:
        raise ValueError("a mask's run lengths do not fit its box")
    out = np.zeros((height, width), bool)
    out[top : top + h, left : left + w] = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(h, w)
    return out


def _read_points(shape: ET.Element, center: float) -> list[Point]:
    pairs = (pair.split(",") for pair in shape.attrib["points"].split(";"))
    return [(float(x) - center, float(y) - center) for x, y in pairs]


def _crossing(number: int, shape: ET.Element) -> Crossing:
    facts = {a.get("name"): float(a.text or 0) for a in shape.iterfind("attribute")}
    return Crossing(
        id=number,
        xy=_read_points(shape, _CENTER)[0],
        over=StrandPosition(instance=int(facts["over"]), u=facts["over_u"]),
        under=StrandPosition(instance=int(facts["under"]), u=facts["under_u"]),
        score=facts.get("score", 1.0),
    )
