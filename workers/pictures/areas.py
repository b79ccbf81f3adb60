"""The ground of a picture, how sharply the rest stands out from it, and the areas of one color in
the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Levels = NDArray[Any]
"""(H, W) gray of 8 or 16 bits, or (H, W, 3) color of 8 bits."""

_SAMPLE = 1_000_000
_SHARP = 0.5
_ALL = 0.9
_BINS = 32
_AREAS = 32
_LEAST_AREA = 0.01
_LEAST_PIXELS = 16
_SAME = 48
"""Colors of areas that differ by less in every plane are one area."""
_BLUR_PX = 3


@dataclass(frozen=True)
class Ground:
    """``level``: the value of the ground, one number a plane; ``share``: of the picture that has
    it; ``distinct``: values that are there beside it, at most 1000 of them, most frequent first;
    ``distance`` (H, W): the largest difference to it over the planes."""

    level: tuple[int, ...]
    share: float
    distinct: list[tuple[int, ...]]
    distance: Levels


def ground_of(levels: Levels) -> Ground:
    """The value that holds most of the picture and of its border, both counted by share. Of two
    that hold as much it is the lower one."""
    planes = levels.reshape(*levels.shape[:2], -1)
    step = max(1, int(np.sqrt(planes.shape[0] * planes.shape[1] / _SAMPLE)))
    inside = planes[::step, ::step].reshape(-1, planes.shape[2])
    border = np.concatenate([planes[0], planes[-1], planes[:, 0], planes[:, -1]])
    codes, counts = np.unique(_codes(inside), return_counts=True)
    around = dict(
        zip(*(a.tolist() for a in np.unique(_codes(border), return_counts=True)), strict=True)
    )
    shares = counts / len(inside)
    both = shares + np.array([around.get(code, 0) for code in codes.tolist()]) / len(border)
    best = int(np.argmax(both))
    others = [k for k in np.argsort(-counts).tolist()[:1001] if k != best]
    level = _planes(int(codes[best]), planes.shape[2])
    return Ground(
        level,
        float(shares[best]),
        [_planes(int(codes[k]), planes.shape[2]) for k in others],
        _distance(levels, level),
    )


def is_sharp(distance: Levels) -> bool:
    """Whether what stands out does so at once: where it meets the ground, most pixels have none
    beside them that is farther from the ground, as nearly all have at a smoothed outline; and all
    levels meet the ground, as those at the middle of a blurred area do not."""
    out = (distance > 0).view(np.uint8)
    rim = (out > 0) & (cv2.erode(out, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))) == 0)
    if not rim.any():
        return False
    rising = rim & (cv2.dilate(distance, np.ones((3, 3), np.uint8)) > distance)
    if np.count_nonzero(rising) >= _SHARP * np.count_nonzero(rim):
        return False
    levels = int(distance.max()) + 1
    pixels, meeting = (np.bincount(distance[where], minlength=levels) for where in (out > 0, rim))
    return bool(pixels[meeting > 0].sum() >= _ALL * pixels.sum())


def area_colors(
    levels: NDArray[np.uint8], distance: NDArray[np.uint8], tolerance: int
) -> NDArray[np.uint8]:
    """(n, planes) colors that hold areas away from the ground: where the 3 × 3 pixels around differ
    by ``tolerance`` at most. At most 32, the largest first."""
    square = np.ones((3, 3), np.uint8)
    spread = cv2.dilate(levels, square) - cv2.erode(levels, square)
    flat = (spread if spread.ndim == 2 else spread.max(axis=2)) <= tolerance
    flat &= distance > max(tolerance, 1)
    colors = levels[flat].reshape(-1, 1 if levels.ndim == 2 else levels.shape[2])
    if not len(colors):
        return np.zeros((0, colors.shape[1]), np.uint8)
    size = 256 // _BINS
    bins, where, counts = np.unique(_codes(colors // size), return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(where, plane, len(bins)) for plane in colors.T], axis=1)
    means = sums / counts[:, None]
    kept: list[NDArray[np.float64]] = []
    for k in np.argsort(-counts):
        if counts[k] < max(_LEAST_PIXELS, _LEAST_AREA * len(colors)) or len(kept) == _AREAS:
            break
        if all(np.abs(means[k] - other).max() >= _SAME for other in kept):
            kept.append(means[k])
    return np.rint(np.array(kept)).astype(np.uint8).reshape(-1, colors.shape[1])


def is_steep(
    levels: NDArray[np.uint8], level: int, distance: NDArray[np.uint8], tolerance: int
) -> bool:
    """Whether an area of this gray level meets the ground within three pixels along most of its
    outline: a probability that falls off slowly does not."""
    area = (np.abs(levels.astype(np.int16) - level) <= max(tolerance, 1)).view(np.uint8)
    outline = (area > 0) & (cv2.erode(area, np.ones((3, 3), np.uint8)) == 0)
    side = 2 * _BLUR_PX + 1
    near_ground = cv2.erode(distance, np.ones((side, side), np.uint8)) <= tolerance
    return bool(np.count_nonzero(outline & near_ground) >= 0.5 * np.count_nonzero(outline))


def nearer_than_ground(
    levels: NDArray[np.uint8], ground: tuple[int, ...], colors: NDArray[np.uint8]
) -> Bool:
    """(H, W): whether a pixel is nearer to one of ``colors`` (n, planes) than to the ground. Colors
    are told apart in steps of 8."""
    planes = len(ground)
    size = 256 // _BINS
    steps = np.arange(_BINS) * size + size // 2
    table = (
        np.stack(np.meshgrid(*[steps] * planes, indexing="ij"), axis=-1)
        .reshape(-1, planes)
        .astype(np.float32)
    )
    to_ground = ((table - np.array(ground, np.float32)) ** 2).sum(axis=1)
    to_areas = np.min(
        [((table - color.astype(np.float32)) ** 2).sum(axis=1) for color in colors], axis=0
    )
    pixels = levels.reshape(*levels.shape[:2], planes) // size
    index = np.zeros(levels.shape[:2], np.int32)
    for plane in range(planes):
        index = index * _BINS + pixels[:, :, plane]
    return np.asarray((to_areas < to_ground)[index])


def _codes(colors: Levels) -> NDArray[np.int64]:
    """(n, planes) to one number each: 16 bits a plane."""
    codes = np.zeros(len(colors), np.int64)
    for plane in range(colors.shape[1]):
        codes = codes * 65536 + colors[:, plane]
    return codes


def _planes(code: int, planes: int) -> tuple[int, ...]:
    return tuple(code >> 16 * (planes - 1 - k) & 0xFFFF for k in range(planes))


def _distance(levels: Levels, ground: tuple[int, ...]) -> Levels:
    if levels.ndim == 2:
        return np.asarray(cv2.absdiff(levels, np.full_like(levels, ground[0])))
    planes = np.moveaxis(levels, 2, 0)
    distances = [
        cv2.absdiff(plane, np.full_like(plane, level))
        for plane, level in zip(planes, ground, strict=True)
    ]
    return np.asarray(np.maximum.reduce(distances))
