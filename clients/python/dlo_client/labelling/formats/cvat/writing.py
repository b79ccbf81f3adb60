"""CVAT for images 1.1 (XML): a mask and a polyline for every instance, tied by ``group_id``;
crossings as points.

CVAT's coordinates are continuous: the first pixel reaches from 0 to 1, so a pixel's center is at a
half. Its XML comes back through :mod:`dlo_client.labelling.formats.cvat.reading`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.sax.saxutils import quoteattr

import numpy as np

from dlo_client.contracts import Point
from dlo_client.labelling.formats.drawn import pairs
from dlo_client.labelling.formats.exchange import CLASS, Labels, written_whole
from dlo_client.labelling.formats.pixels import Mask, Ring, decode
from dlo_client.labelling.labels import PictureLabel

CENTER = 0.5
_ATTRIBUTES = {
    "dlo": ("width_px", "closed", "score"),
    "crossing": ("over", "over_u", "under", "under_u", "score"),
}


def write(labels: Labels, out: Path) -> Path:
    """``cvat.xml``; its job needs the labels that ``<meta>`` lists: ``dlo`` and ``crossing``."""
    file = out / "cvat.xml"
    with written_whole(file) as xml:
        xml.write(
            f'<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n{_meta()}\n'
        )
        for number, label in enumerate(labels()):
            size = f'width="{label.width}" height="{label.height}"'
            xml.write(f'<image id="{number}" name={quoteattr(label.name)} {size}>\n')
            xml.writelines(_shapes(label))
            xml.write("</image>\n")
        xml.write("</annotations>\n")
    return file


def points_of(shape: Element) -> Ring:
    """(n, 2) in CVAT's coordinates, as they stand there. Raises Refused."""
    text = shape.get("points", "")
    return pairs([pair.split(",") for pair in text.split(";")] if text else [], f"a {shape.tag}")


def _meta() -> str:
    labels = []
    for name, attributes in _ATTRIBUTES.items():
        listed = "".join(
            f"<attribute><name>{a}</name><mutable>False</mutable><input_type>text</input_type>"
            f"<default_value></default_value><values></values></attribute>"
            for a in attributes
        )
        labels.append(
            f"<label><name>{name}</name><type>any</type><attributes>{listed}</attributes></label>"
        )
    return f"<meta><task><mode>annotation</mode><labels>{''.join(labels)}</labels></task></meta>"


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
            "over": crossing.over.instance,
            "over_u": crossing.over.u,
            "under": crossing.under.instance,
            "under_u": crossing.under.u,
            "score": crossing.score,
        }
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
    return ";".join(f"{x + CENTER:.2f},{y + CENTER:.2f}" for x, y in points_xy)
