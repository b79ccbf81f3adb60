"""CVAT's XML, for images and for video, back into labels.

Shapes of one ``group_id`` are one DLO, those of group 0 (what a person adds) one each. Tracks of a
video are read frame by frame: see :mod:`dlo_client.labelling.formats.cvat.tracks`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError

import defusedxml.ElementTree
import numpy as np
from defusedxml.common import DefusedXmlException

from dlo_client.labelling.formats.cvat.tracks import Frame, frames_of
from dlo_client.labelling.formats.cvat.writing import CENTER, points_of
from dlo_client.labelling.formats.drawn import whole
from dlo_client.labelling.formats.exchange import FormatError, Imported, Refused
from dlo_client.labelling.formats.gate import Canvas, Drawn, Wanted, no_outline, settle
from dlo_client.labelling.formats.pixels import Mask
from dlo_client.labelling.formats.run_lengths import runs_of
from dlo_client.labelling.labels import PictureLabel

_SHAPES = {"mask", "polygon", "polyline", "points", "box", "ellipse", "cuboid", "tag", "skeleton"}


def read(path: Path, wanted: Wanted = Wanted()) -> Imported:  # noqa: B008
    """Raises FormatError for what is no CVAT file; entities and document types are refused."""
    root = _root(path)
    imported = Imported()
    images = list(root.iter("image"))
    for image in images:
        name = image.get("name") or "an image without a name"
        with imported.one_picture(name):
            size = (image.get("width"), image.get("height"))
            imported.labels.append(
                _label(name, size, [s for s in image if s.tag in _SHAPES], wanted, imported)
            )
    frames = frames_of(root, wanted, imported)
    for frame in frames:
        with imported.one_picture(frame.name):
            imported.labels.append(
                _label(frame.name, _size(frame, wanted), frame.shapes, wanted, imported)
            )
    if not images and not frames and not imported.problems and not imported.not_annotated:
        raise FormatError(f"{path}: has neither images nor tracks")
    return settle(imported, wanted)


def _root(path: Path) -> Element:
    try:
        root: Element = defusedxml.ElementTree.fromstring(path.read_bytes(), forbid_dtd=True)
    except DefusedXmlException as error:
        raise FormatError(f"{path}: declares a document type or entities") from error
    except (OSError, ParseError, ValueError, LookupError, RecursionError) as error:
        raise FormatError(f"{path}: {error}") from error
    if root.tag != "annotations":
        raise FormatError(f"{path}: no <annotations>")
    return root


def _size(frame: Frame, wanted: Wanted) -> tuple[object, object]:
    """What the file states, else the picture's own."""
    return frame.size if None not in frame.size else wanted.sizes.get(frame.name, frame.size)


def _label(
    name: str,
    size: tuple[object, object],
    shapes: Iterable[Element],
    wanted: Wanted,
    imported: Imported,
) -> PictureLabel:
    canvas = Canvas(name, size, wanted, imported)
    groups: dict[str, list[Element]] = {}
    for k, shape in enumerate(shapes):
        called = shape.get("label", "")
        if wanted.takes(called):
            group = shape.get("group_id") or "0"
            groups.setdefault(group if group != "0" else f"new {k}", []).append(shape)
        elif called == "crossing" and shape.tag == "points":
            _cross(canvas, shape)
        elif shape.tag == "tag":
            canvas.leave_out(f"tag '{called}'")
        else:
            canvas.other_class(called)
    for group, members in groups.items():
        canvas.add(_drawn(group, members, canvas))
    return canvas.label()


def _drawn(group: str, shapes: list[Element], canvas: Canvas) -> Drawn:
    """One DLO from the shapes of its group."""
    place = f"group {group[:40]}" if len(shapes) > 1 else f"a {shapes[0].tag}"
    facts = {k: v for shape in shapes for k, v in _facts(shape).items()}
    drawn = Drawn(place, number=group, width_px=facts.get("width_px"), closed=facts.get("closed"))
    for shape in shapes:
        if shape.tag == "mask":
            drawn.masks.append(_mask(shape, canvas))
        elif shape.tag == "polygon":
            drawn.rings.append(points_of(shape))
        elif shape.tag == "polyline":
            drawn.lines.append(points_of(shape) - CENTER)
        else:
            raise no_outline(shape.tag)
    return drawn


def _facts(shape: Element) -> dict[str, str]:
    return {a.get("name", ""): a.text for a in shape.iterfind("attribute") if a.text}


def _mask(shape: Element, canvas: Canvas) -> Mask:
    left, top = (whole(shape.get(key), f"a mask's {key}", 0, 65_535) for key in ("left", "top"))
    w, h = (whole(shape.get(key), f"a mask's {key}", 1, 65_535) for key in ("width", "height"))
    if left + w > canvas.width or top + h > canvas.height:
        raise Refused("a mask's box does not fit the picture")
    values = shape.get("rle", "").split(",")
    runs = runs_of(values, w * h)
    out = np.zeros((canvas.height, canvas.width), bool)
    out[top : top + h, left : left + w] = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(
        h, w
    )
    return out


def _cross(canvas: Canvas, shape: Element) -> None:
    facts = _facts(shape)
    points = points_of(shape) - CENTER
    strands: dict[str, Any] = {
        key: {"instance": facts.get(key), "u": facts.get(f"{key}_u")} for key in ("over", "under")
    }
    canvas.cross(
        {
            **strands,
            "xy": points[0].tolist() if len(points) else None,
            "score": facts.get("score") or 1.0,
        }
    )
