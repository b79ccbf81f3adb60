"""Corrected strokes to labels: polygons of the DLO's thickness, the nearer one on top (thesis
2.5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.directions import quarter_turned, tangents, unit
from models.geometry.polylines import arc_lengths, crossing_segments
from models.tracked_labels.correction import CorrectedStroke
from models.tracked_labels.strokes import stretches

_SHIFT = 4
_SURE = 0.5
"""Trust of a crop from which its width counts."""


@dataclass(frozen=True, eq=False)
class Strand:
    """A DLO in one view: ``xy`` (n, 2) centerline in the picture, ``width_px`` (n,), ``depth_m``
    (n,)."""

    xy: FloatArray
    width_px: FloatArray
    depth_m: FloatArray


@dataclass(frozen=True)
class StrandCrossing:
    """``over`` and ``under``: number of the strand (from 0) and place on it, 0 to 1 by arc length;
    ``gap_m`` how much nearer the upper one is."""

    xy: tuple[float, float]
    over: tuple[int, float]
    under: tuple[int, float]
    gap_m: float


def strand_of(
    stroke: CorrectedStroke,
    thickness_m: float,
    focal_px: float,
    size: tuple[int, int],
    measured: float = 0.7,
) -> Strand | None:
    """The longest stretch in the picture of ``size`` (width, height), or None. Where the stroke
    goes on outside, the stretch reaches the border. Its width is the thickness at its depth,
    corrected by how much wider or narrower the crops say that it is: ``measured`` is the share that
    the crops have in the logarithm. Where none of them is sure the thickness stands."""
    runs = stretches(np.isfinite(stroke.offset_px))
    if not runs:
        return None
    run = max(runs, key=lambda r: r.stop - r.start)
    nominal = thickness_m * focal_px / stroke.depth_m[run]
    trust = stroke.trust[run]
    good = (trust >= np.quantile(trust, 0.5)) & (trust >= _SURE)
    ratio = (
        float(np.median(np.log(stroke.width_px[run][good] / nominal[good]))) if good.any() else 0.0
    )
    return Strand(
        _to_border(stroke.xy[run], run, len(stroke.xy), size),
        nominal * np.exp(measured * ratio),
        stroke.depth_m[run],
    )


def _to_border(xy: FloatArray, run: slice, samples: int, size: tuple[int, int]) -> FloatArray:
    """(n, 2) with its ends moved on to the border, by less than a step, where the stroke goes
    on."""
    xy = xy.copy()
    last = np.array(size, np.float64) - 1
    for goes_on, end, before in ((run.start > 0, 0, 1), (run.stop < samples, -1, -2)):
        step = xy[end] - xy[before]
        room = np.where(step > 0, last - xy[end], xy[end]) / np.maximum(np.abs(step), 1e-9)
        if goes_on and room.min() < 1.5:
            xy[end] += room.min() * step
    return xy


def outline(strand: Strand) -> FloatArray:
    """(2n, 2) polygon that follows the contour of the DLO."""
    side = quarter_turned(tangents(strand.xy)) * (strand.width_px / 2)[:, None]
    return np.concatenate([strand.xy + side, (strand.xy - side)[::-1]])


def draw_ids(strands: Sequence[Strand | None], height: int, width: int) -> ByteArray:
    """(H, W) ids, 0 background, k + 1 the k-th strand where it is the nearest. At most 255 strands.

    Pieces of all strands are painted from the farthest to the nearest.
    """
    pieces: list[tuple[float, int, FloatArray]] = []
    for k, strand in enumerate(strands, start=1):
        if strand is None:
            continue
        whole = outline(strand)
        n = len(strand.xy)
        for i in range(n - 1):
            quad = np.stack([whole[i], whole[i + 1], whole[2 * n - 2 - i], whole[2 * n - 1 - i]])
            pieces.append((float(strand.depth_m[i : i + 2].mean()), k, quad))
    ids = np.zeros((height * 2, width * 2), np.uint8)
    for _, k, quad in sorted(pieces, key=lambda piece: -piece[0]):
        # Twice as fine, because OpenCV's outlines are drawn half a pixel too wide.
        fixed = np.rint(((quad + 0.5) * 2 - 0.5) * (1 << _SHIFT)).astype(np.int32)
        cv2.fillConvexPoly(ids, _shrunk(fixed), k, cv2.LINE_8, _SHIFT)
    return np.ascontiguousarray(ids[::2, ::2])


def find_crossings(strands: Sequence[Strand | None]) -> list[StrandCrossing]:
    """Where centerlines cross in the picture; the one nearer to the camera is over. Neighbors on
    one strand do not."""
    starts, ends, owner, place, depth = [], [], [], [], []
    for k, strand in enumerate(strands):
        if strand is None:
            continue
        lengths = arc_lengths(strand.xy)
        starts.append(strand.xy[:-1])
        ends.append(strand.xy[1:])
        owner.append(np.full(len(strand.xy) - 1, k))
        place.append(np.stack([lengths[:-1], lengths[1:]], 1) / max(lengths[-1], 1e-9))
        depth.append(np.stack([strand.depth_m[:-1], strand.depth_m[1:]], 1))
    if not starts:
        return []
    who, at, far = np.concatenate(owner), np.concatenate(place), np.concatenate(depth)
    found = crossing_segments(np.concatenate(starts), np.concatenate(ends))
    crossings = []
    for i, j, t, u, xy in zip(*found, strict=True):
        first = (int(who[i]), float(at[i] @ (1 - t, t)), float(far[i] @ (1 - t, t)))
        second = (int(who[j]), float(at[j] @ (1 - u, u)), float(far[j] @ (1 - u, u)))
        over, under = (first, second) if first[2] <= second[2] else (second, first)
        crossings.append(
            StrandCrossing((float(xy[0]), float(xy[1])), over[:2], under[:2], under[2] - over[2])
        )
    return crossings


def _shrunk(quad: np.ndarray) -> np.ndarray:
    """By a quarter of a fine pixel towards its middle line, across the strand alone: pieces must
    still touch."""
    quad = quad.copy()
    for a, b in ((0, 3), (1, 2)):
        across = (quad[b] - quad[a]).astype(np.float64)
        inward = unit(across) * 0.5 * (1 << _SHIFT)
        quad[a] += np.rint(inward).astype(np.int32)
        quad[b] -= np.rint(inward).astype(np.int32)
    return quad
