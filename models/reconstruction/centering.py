"""Centerlines to a fraction of a pixel: the middle between the two edges of the foreground
probability.

Strategy: at every point of a centerline the probability is read along the normal; from the center
outward, each edge is where it falls to half. The point moves to the middle of the edges, and the
distance between them is the DLO's width there. Where the edges are missing or too far apart
(another DLO crosses or touches, the border of the picture cuts the profile) nothing is known: the
offset is interpolated between the neighbors, and the ends of the centerline, which the instance
methods let run into the border, are cut. Offsets are smoothed along the DLO.

With the picture beside it, each edge then goes to where the picture's colors, smoothed along the
DLO, change the most: a soft shadow beside a DLO moves the edge of the probability, in one view and
not in the other, but is no such edge.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.geometry.directions import quarter_turned, unit
from models.geometry.polylines import arc_lengths, resample

_STEP_PX = 1.0
_PROFILE_PX = 0.25
_MOST_PLACES = 4_000_000
"""Of all profiles together; of a wider DLO a part of a pixel means little."""
_OUTSIDE = 4
"""Places at either end of a profile that show the ground."""
_COLORED, _LEAST_HUE = 0.3, 12.0
"""Share of the difference between DLO and ground that is one of hue, and its size (of 255), to be
used alone."""
_LEVEL = 0.5
"""Of the edge, as a share of the profile's height at its center."""
_WIDER = 1.5
"""Edges farther apart than so many typical widths belong to two DLOs."""
_SMOOTH_PX = 3.0
"""Along the DLO."""
_ROUNDS = 2
"""Normals improve with the line."""
_COLORS_PX = 6.0
"""How far along the DLO the picture's colors are smoothed."""
_REACH_PX, _REACH_WIDTHS = 1.5, 0.15
"""From the edges of the probability to those of the picture."""


def center(
    centerline_xy: FloatArray,
    width_px: float,
    probability: Float32Array,
    image: ByteArray | None = None,
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """(n, 2) centerline about every pixel, its (n,) widths, and (n,) where both edges are clear;
    None if they are nowhere.

    ``probability`` (H, W) 0 to 1 of the picture ``image`` (H, W, 3) that ``centerline_xy`` (m, 2)
    is from.
    """
    count = max(int(arc_lengths(centerline_xy)[-1] / _STEP_PX) + 1, 4)
    line = resample(centerline_xy, count)
    for _ in range(_ROUNDS):
        normal = _normals(line)
        low, high, known = _edges(line, normal, width_px, probability)
        if known.sum() < 4:
            return None
        first, last = np.flatnonzero(known)[[0, -1]]
        at = np.flatnonzero(known)
        index = np.arange(first, last + 1)
        shift = _smooth(np.interp(index, at, ((low + high) / 2)[known]), _SMOOTH_PX)
        width = _smooth(np.interp(index, at, (high - low)[known]), _SMOOTH_PX)
        line = line[index] + shift[:, None] * normal[index]
    if image is None:
        return line, width, known[index]
    return *_onto_edges(line, width, known[index], image), known[index]


def _onto_edges(
    line: FloatArray, width: FloatArray, known: BoolArray, image: ByteArray
) -> tuple[FloatArray, FloatArray]:
    """``line`` (n, 2) in the middle between the picture's edges, and the (n,) distance of those;
    between what is ``known`` (n,) they are interpolated."""
    normal = _normals(line)
    reach = max(_REACH_PX, _REACH_WIDTHS * float(np.median(width)))
    half = int(np.ceil((float(width.max()) / 2 + reach + 1.0) / _PROFILE_PX))
    across: FloatArray = np.asarray(np.arange(-half, half + 1) * _PROFILE_PX, np.float64)
    if len(line) * len(across) > _MOST_PLACES:
        return line, width
    at = line[:, None] + across[:, None] * normal[:, None]
    x, y = (at[..., axis].astype(np.float32) for axis in (0, 1))
    read = cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    colors = gaussian_filter1d(read.astype(np.float64), _COLORS_PX, axis=0, mode="nearest")
    colors = gaussian_filter1d(colors, 0.5 / _PROFILE_PX, axis=1, mode="nearest")
    index, sure = np.arange(len(line)), np.flatnonzero(known)
    steepest = [
        _steepest(_change(colors, half, side), across, width, side, reach) for side in (-1, 1)
    ]
    low, high = (np.interp(index, sure, places[sure]) for places in steepest)
    low, high = _smooth(low, _SMOOTH_PX), _smooth(high, _SMOOTH_PX)
    return line + ((low + high) / 2)[:, None] * normal, np.maximum(high - low, _PROFILE_PX)


def _change(colors: FloatArray, middle: int, side: int) -> FloatArray:
    """(n, a) how much (n, a, 3) ``colors`` change across the DLO whose center is at ``middle``.

    A shadow scales the color of the ground. Where the DLO has another hue than the ground on that
    ``side`` only what goes from one hue to the other counts.
    """
    slope = np.gradient(colors, axis=1)
    edge = colors[:, :_OUTSIDE] if side < 0 else colors[:, -_OUTSIDE:]
    ground, own = (
        np.median(edge, axis=(0, 1)),
        np.median(colors[:, middle - 2 : middle + 3], axis=(0, 1)),
    )
    gray = ground / max(float(np.linalg.norm(ground)), 1e-9)
    away = own - ground
    hue = away - (away @ gray) * gray
    size = float(np.linalg.norm(hue))
    if size < _COLORED * np.linalg.norm(away) or size < _LEAST_HUE:
        return np.asarray(np.linalg.norm(slope, axis=2))
    return np.asarray(np.abs(slope @ (hue / size)))


def _steepest(
    change: FloatArray, across: FloatArray, width: FloatArray, side: int, reach: float
) -> FloatArray:
    """(n,) where (n, a) ``change`` at the places ``across`` (a,) is largest within ``reach`` of
    half the (n,) ``width`` to the ``side``: the top of the parabola through three values."""
    near = np.where(np.abs(across[None] - side * width[:, None] / 2) <= reach, change, -1.0)
    top = np.clip(np.argmax(near, axis=1), 1, len(across) - 2)
    rows = np.arange(len(width))
    before, here, after = (change[rows, top + k] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    share = np.where(bend < 0, 0.5 * (before - after) / np.minimum(bend, -1e-9), 0.0)
    return np.asarray(across[top] + _PROFILE_PX * np.clip(share, -1, 1))


def _edges(
    line: FloatArray,
    normal: FloatArray,
    width_px: float,
    probability: Float32Array,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(n,) signed distances of the two edges along the normal, and where both are known."""
    reach = max(width_px, 2.0) * _WIDER / 2 + 2.0
    half = int(np.ceil(reach / _PROFILE_PX))
    across = np.arange(-half, half + 1) * _PROFILE_PX
    at = line[:, None] + across[:, None] * normal[:, None]
    x, y = (at[..., axis].astype(np.float32) for axis in (0, 1))
    outside = -1.0
    read = cv2.remap(
        probability, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=outside
    )
    profile = np.asarray(read, np.float32)
    # the center may lie beside a thin DLO at first: start from the highest place nearby
    near = np.abs(across) <= max(width_px / 2, 1.5)
    top = np.flatnonzero(near)[0] + np.argmax(
        profile[:, near] - 1e-3 * np.abs(across[near]), axis=1
    )
    height = profile[np.arange(len(line)), top]
    level = _LEVEL * height[:, None]
    above = profile >= level
    low = _crossing(profile[:, ::-1], level, above[:, ::-1], len(across) - 1 - top)
    high = _crossing(profile, level, above, top)
    low, high = -(low - half) * _PROFILE_PX, (high - half) * _PROFILE_PX
    inside = profile.min(axis=1) >= 0
    known = inside & (height > 0.2) & np.isfinite(low) & np.isfinite(high)
    width = np.where(known, high - low, np.nan)
    typical = float(np.nanmedian(width)) if known.any() else 0.0
    return (
        low,
        high,
        known & (np.nan_to_num(width) < _WIDER * typical) & (np.nan_to_num(width) > typical / 2),
    )


def _crossing(
    profile: Float32Array, level: Float32Array, above: BoolArray, start: FloatArray
) -> FloatArray:
    """(n,) index, with fraction, at which each row first falls below its level after ``start``; NaN
    if never."""
    columns = np.arange(profile.shape[1])
    below = ~above & (columns[None] > np.asarray(start)[:, None])
    first = np.argmax(below, axis=1)
    rows = np.arange(len(profile))
    found = below.any(axis=1)
    before, after = profile[rows, first - 1], profile[rows, first]
    share = (before - level[:, 0]) / np.maximum(before - after, 1e-6)
    return np.where(found, first - 1 + np.clip(share, 0, 1), np.nan)


def _smooth(values: FloatArray, sigma: float) -> FloatArray:
    calm = median_filter(values, size=min(5, len(values)), mode="nearest")
    return np.asarray(gaussian_filter1d(calm, sigma, mode="nearest"), np.float64)


def _normals(line: FloatArray) -> FloatArray:
    tangent = gaussian_filter1d(np.gradient(line, axis=0), 3.0, axis=0, mode="nearest")
    return quarter_turned(unit(tangent))
