"""What all formats share: masks, outlines, files written whole."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as coco_mask

from dlo_client.contracts import MaskRLE, Point
from dlo_client.labelling.labels import LabelledInstance, PictureLabel

Labels = Callable[[], Iterable[PictureLabel]]
Mask = NDArray[np.bool_]
CLASS = "dlo"
_DEFAULT_WIDTH_PX = 6.0


class FormatError(ValueError):
    """A file is not of the format, or broken beyond one picture; the message says where."""


@dataclass
class Imported:
    """``labels`` that could be read and, by picture or place in the file, the ``problems`` with the rest."""

    labels: list[PictureLabel] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)


def decode(rle: MaskRLE) -> Mask:
    """(H, W) mask."""
    return np.asarray(coco_mask.decode({"size": list(rle.size), "counts": rle.counts.encode()}), bool)


def encode(mask: Mask) -> MaskRLE:
    rle = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    return MaskRLE(size=(mask.shape[0], mask.shape[1]), counts=rle["counts"].decode())


def box(rle: MaskRLE) -> tuple[list[float], int]:
    """COCO's bounding box ``[x, y, width, height]`` and the area, px."""
    raw = {"size": list(rle.size), "counts": rle.counts.encode()}
    return [float(v) for v in coco_mask.toBbox(raw)], int(coco_mask.area(raw))


def outlines(mask: Mask) -> list[NDArray[np.float64]]:
    """One ring (n, 2) for every connected piece, in continuous coordinates: pixel k reaches from k to k + 1.

    The ring lies a quarter of a pixel inside the pixels' edges: all centers of the piece lie in it and no others,
    and rounded down it runs through the outermost pixels. Readers of either convention get the mask back exactly.
    A hole is joined to its ring by a cut of no width.
    """
    doubled = cv2.resize(mask.astype(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    found, nesting = cv2.findContours(doubled, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    rings = [(np.asarray(c, np.float64).reshape(-1, 2) + 0.5) / 2 for c in found]
    outer = {k: ring for k, ring in enumerate(rings) if nesting[0][k][3] < 0}
    for k, ring in enumerate(rings):
        parent = int(nesting[0][k][3])
        if parent >= 0:
            outer[parent] = _joined(outer[parent], ring)
    return list(outer.values())


def joined(rings: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """All rings as one, by cuts of no width: there and back along the same line."""
    whole = rings[0]
    for ring in rings[1:]:
        whole = _joined(whole, ring)
    return whole


def fill(rings: Sequence[NDArray[np.float64]], height: int, width: int) -> Mask:
    """The mask of all rings together, in the same coordinates."""
    flat = [ring.ravel().tolist() for ring in rings if len(ring) >= 3]
    if not flat:
        return np.zeros((height, width), bool)
    return np.asarray(coco_mask.decode(coco_mask.merge(coco_mask.frPyObjects(flat, height, width))), bool)


def stroke(points_xy: Sequence[Point], width_px: float, height: int, width: int) -> Mask:
    """A line of this width, for tools that know lines but no masks."""
    canvas = np.zeros((height, width), np.uint8)
    fixed = np.rint(np.asarray(points_xy, np.float64) * 16).astype(np.int32)
    cv2.polylines(canvas, [fixed], False, 1, max(1, round(width_px)), cv2.LINE_8, 4)
    return canvas > 0


def mean_width(mask: Mask) -> float:
    """A rough width of a strand, px: four times the mean distance from its pixels to the outside."""
    padded = np.pad(mask.astype(np.uint8), 1)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    return max(1.0, float(4 * distance[mask].mean()) - 1.0) if mask.any() else 1.0


def instance_of(number: int, mask: Mask, line: list[Point], width_px: float | None, closed: bool) -> LabelledInstance:
    """What a tool says of one DLO. Without a mask a stroke along the line stands for it; a width may be the mask's."""
    if not mask.any() and line:
        mask = stroke(line, width_px or _DEFAULT_WIDTH_PX, *mask.shape)
    return LabelledInstance(
        id=number, centerline_xy=line, width_px=width_px or mean_width(mask), closed=closed, mask_rle=encode(mask)
    )


@contextmanager
def written_whole(file: Path) -> Iterator[IO[str]]:
    """A text file that takes its place when it is complete."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.part")
    try:
        with partial.open("w", encoding="utf-8") as out:
            yield out
        partial.replace(file)
    finally:
        partial.unlink(missing_ok=True)


def write_list(out: IO[str], items: Iterable[Any]) -> None:
    """A JSON list, item by item."""
    out.write("[")
    for k, item in enumerate(items):
        out.write(",\n" if k else "\n")
        json.dump(item, out, ensure_ascii=False)
    out.write("]")


def read_json(file: Path) -> Any:
    """Raises FormatError."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FormatError(f"{file}: {error}") from error


def _joined(ring: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    distance = ((ring[:, None] - other[None]) ** 2).sum(2)
    i, j = np.unravel_index(int(distance.argmin()), distance.shape)
    around = np.concatenate([other[j:], other[: j + 1]])
    return np.concatenate([ring[: i + 1], around, ring[i:]])
