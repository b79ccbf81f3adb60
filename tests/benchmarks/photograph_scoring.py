"""Foreground against hand-marked photographs, where some areas cannot be told.

Truth of a picture: ``lines/ID.json``, ``[{"xy": [[x, y], …], "width": w | [w, …]}, …]`` in pixels
of the picture, and ``masks/ID.png``: 255 cable, 0 background, 128 cannot tell, which counts
nowhere.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from skimage.morphology import skeletonize

UNKNOWN = 128
_LEAST_REACH_PX = 1.5


class Stroke(NamedTuple):
    """``xy`` (n, 2) a middle line about every 2 px, ``widths`` (n,) px."""

    xy: np.ndarray
    widths: np.ndarray


class Share(NamedTuple):
    """``found``: of the true middle lines, by length, with a predicted pixel within half the width.
    ``right``: of the predicted skeleton, by pixels, that is on a cable with half a width of
    tolerance. ``dice`` of the pixels. None where there is nothing to divide by."""

    found: float | None
    right: float | None
    dice: float


def read_truth(folder: Path, name: str) -> tuple[list[Stroke], np.ndarray]:
    """Strokes and label picture (H, W) of one photograph."""
    strokes = []
    for line in json.loads((folder / "lines" / f"{name}.json").read_text()):
        xy = np.asarray(line["xy"], float)
        strokes.append(Stroke(xy, np.broadcast_to(np.asarray(line["width"], float), len(xy))))
    return strokes, cv2.imread(str(folder / "masks" / f"{name}.png"), cv2.IMREAD_GRAYSCALE)


def score_photograph(found: np.ndarray, strokes: Sequence[Stroke], labels: np.ndarray) -> Share:
    """``found`` (H, W) bool against ``strokes`` and ``labels`` (H, W) 255, 128 or 0."""
    known = labels != UNKNOWN
    bones = skeletonize(found) & known
    lanes = _lanes(strokes, labels)
    return Share(
        found=_found(found, strokes, known),
        right=float((bones & lanes).sum() / bones.sum()) if bones.any() else None,
        dice=_dice(found & known, (labels == 255) & known),
    )


def mean_shares(shares: Sequence[Share]) -> dict[str, float]:
    """Percent: the mean of each figure over the photographs that have it."""
    return {
        name: round(
            100
            * float(np.mean([v for s in shares if (v := getattr(s, name)) is not None] or [0.0])),
            2,
        )
        for name in Share._fields
    }


def _found(found: np.ndarray, strokes: Sequence[Stroke], known: np.ndarray) -> float | None:
    away = cv2.distanceTransform((~found).astype(np.uint8), cv2.DIST_L2, 5)
    hits = total = 0
    height, width = found.shape
    for xy, widths in strokes:
        column, row = np.rint(xy).astype(int).T
        inside = (xy >= 0).all(1) & (xy[:, 0] <= width - 1) & (xy[:, 1] <= height - 1)
        row, column, reach = (
            row[inside],
            column[inside],
            np.maximum(widths[inside] / 2, _LEAST_REACH_PX),
        )
        counts = known[row, column]
        hits += int((away[row, column] <= reach)[counts].sum())
        total += int(counts.sum())
    return hits / total if total else None


def _lanes(strokes: Sequence[Stroke], labels: np.ndarray) -> np.ndarray:
    """Cable pixels, and half a width around every stroke."""
    lanes = labels == 255
    for xy, widths in strokes:
        typical = float(np.median(widths))
        lane = np.zeros(labels.shape, np.uint8)
        cv2.polylines(lane, [np.rint(xy).astype(np.int32)], False, 1, max(1, round(typical)))
        size = 2 * max(2, round(typical / 2)) + 1
        lanes = lanes | (
            cv2.dilate(lane, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))) > 0
        )
    return lanes


def _dice(found: np.ndarray, true: np.ndarray) -> float:
    total = int(found.sum() + true.sum())
    return float(2 * (found & true).sum() / total) if total else 1.0
