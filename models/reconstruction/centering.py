"""Centerlines to a fraction of a pixel: the middle between the two edges of the foreground probability.

Strategy: at every point of a centerline the probability is read along the normal; from the center outward, each
edge is where it falls to half. The point moves to the middle of the edges, and the distance between them is the
DLO's width there. Where the edges are missing or too far apart (another DLO crosses or touches, the border of the
picture cuts the profile) nothing is known: the offset is interpolated between the neighbors, and the ends of the
centerline, which the instance methods let run into the border, are cut. Offsets are smoothed along the DLO.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from models.geometry.arrays import BoolArray, Float32Array, FloatArray
from models.geometry.polylines import arc_lengths, resample

_STEP_PX = 1.0
_PROFILE_PX = 0.25


@dataclass(frozen=True)
class CenterParams:
    """``level``: of the edge, as a share of the profile's height at its center. ``wider``: edges farther apart than so
    many typical widths belong to two DLOs. ``smooth_px`` along the DLO. ``rounds``: normals improve with the line."""

    level: float = 0.5
    wider: float = 1.5
    smooth_px: float = 3.0
    rounds: int = 2


def center(
    centerline_xy: FloatArray, width_px: float, probability: Float32Array, params: CenterParams | None = None
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """(n, 2) centerline about every pixel, its (n,) widths, and (n,) where both edges are clear; None if they are
    nowhere.

    ``probability`` (H, W) 0 to 1 of the picture that ``centerline_xy`` (m, 2) is from.
    """
    settings = params or CenterParams()
    count = max(int(arc_lengths(centerline_xy)[-1] / _STEP_PX) + 1, 4)
    line = resample(centerline_xy, count)
    for _ in range(settings.rounds):
        normal = _normals(line)
        low, high, known = _edges(line, normal, width_px, probability, settings)
        if known.sum() < 4:
            return None
        first, last = np.flatnonzero(known)[[0, -1]]
        at = np.flatnonzero(known)
        index = np.arange(first, last + 1)
        shift = _smooth(np.interp(index, at, ((low + high) / 2)[known]), settings.smooth_px)
        width = _smooth(np.interp(index, at, (high - low)[known]), settings.smooth_px)
        line = line[index] + shift[:, None] * normal[index]
    return line, width, known[index]


def _edges(
    line: FloatArray, normal: FloatArray, width_px: float, probability: Float32Array, params: CenterParams
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(n,) signed distances of the two edges along the normal, and where both are known."""
    reach = max(width_px, 2.0) * params.wider / 2 + 2.0
    half = int(np.ceil(reach / _PROFILE_PX))
    across = np.arange(-half, half + 1) * _PROFILE_PX
    at = line[:, None] + across[:, None] * normal[:, None]
    x, y = (at[..., axis].astype(np.float32) for axis in (0, 1))
    outside = -1.0
    read = cv2.remap(probability, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=outside)
    profile = np.asarray(read, np.float32)
    # the center may lie beside a thin DLO at first: start from the highest place nearby
    near = np.abs(across) <= max(width_px / 2, 1.5)
    top = np.flatnonzero(near)[0] + np.argmax(profile[:, near] - 1e-3 * np.abs(across[near]), axis=1)
    height = profile[np.arange(len(line)), top]
    level = params.level * height[:, None]
    above = profile >= level
    low = _crossing(profile[:, ::-1], level, above[:, ::-1], len(across) - 1 - top)
    high = _crossing(profile, level, above, top)
    low, high = -(low - half) * _PROFILE_PX, (high - half) * _PROFILE_PX
    inside = profile.min(axis=1) >= 0
    known = inside & (height > 0.2) & np.isfinite(low) & np.isfinite(high)
    width = np.where(known, high - low, np.nan)
    typical = float(np.nanmedian(width)) if known.any() else 0.0
    return low, high, known & (np.nan_to_num(width) < params.wider * typical) & (np.nan_to_num(width) > typical / 2)


def _crossing(profile: Float32Array, level: Float32Array, above: BoolArray, start: FloatArray) -> FloatArray:
    """(n,) index, with fraction, at which each row first falls below its level after ``start``; NaN if never."""
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
    tangent /= np.maximum(np.hypot(*tangent.T)[:, None], 1e-9)
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
