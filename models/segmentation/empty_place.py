"""Pictures of the empty place against one with cables in it: what looks as it always does is hardly
a cable.

Strategy: each picture of the empty place is brought over the picture (phase correlation, then ECC;
what may be a cable is left out). The logarithm of the ratio of both is what has changed: light and
the shadow of an arm are the part of it that is the same over an area wide against a cable, which a
median finds and keeps the edges of. What is left over is smoothed with its sign, so that edges that
are a little beside one another cancel, and measured in what it usually is in this pair of pictures
where the place is as steep: noise, blur and misalignment need not be known. The network's log odds
gain or lose with it by a function that was fitted on rendered cells
(``models.training.foreground.empty_place``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

LONG_SIDE = 640
"""Pictures are compared at most this long."""
MAYBE_CABLE = 0.3
_LEAST_SIDE = 32
"""Pixels, of a picture that another one can be brought over."""
_CONTRAST_PX = 12.0
_LEAST_CORRELATION = 0.35
_FARTHEST = 0.12
"""Shift, as a share of the picture's longer side, beyond which the camera is taken for another
one."""
_AREA = 0.16
"""Side of the area that light is estimated over, as a share of the picture's longer side."""
_DARK = 0.03
"""Added to intensities before the logarithm: what is darker is mostly noise."""
_SMOOTH_PX = 1.8
_STEEPNESS_LEVELS = 8
_LEAST_PIXELS = 200
"""Of a level of steepness, for its usual change to be known."""
_LEAST_USUAL = 0.006
_TO_DEVIATION = 1 / 0.6745
"""From the median of absolute values to the standard deviation of a normal distribution."""
_MOST_CHANGE = 12.0
_SAME = 3.0
"""A change below this is what an unchanged place shows."""


class Weights(NamedTuple):
    """Of the logarithm of 1 + change and the network's log odds, to what is added to the log
    odds."""

    constant: float
    change: float
    change_squared: float
    odds: float
    odds_change: float


WEIGHTS = Weights(-3.71, 0.04, 0.73, -0.57, 0.09)


@dataclass(frozen=True)
class Weighed:
    """``probability`` (H, W); ``reason`` why the pictures of the empty place were of no use, and
    then nothing changed; ``agreement`` share of the picture that looks as before; ``relied`` mean
    change of probability where there is cable before or after; ``shift_px`` of the camera, at the
    picture's middle."""

    probability: Float32Array
    agreement: float
    relied: float
    shift_px: float
    reason: str | None = None


def weigh(
    image: ByteArray,
    probability: Float32Array,
    places: Sequence[ByteArray],
    weights: Weights = WEIGHTS,
) -> Weighed:
    """``probability`` (H, W) of cable in ``image`` (H, W, 3) given ``places``, pictures of the same
    size."""
    scale = min(1.0, LONG_SIDE / max(image.shape[:2]))
    if min(image.shape[:2]) * scale < _LEAST_SIDE:
        return Weighed(probability, 0.0, 0.0, 0.0, "the picture is too small to compare")
    small, odds = _reduced(image, scale), log_odds(_reduced(probability, scale))
    free = odds < np.log(MAYBE_CABLE / (1 - MAYBE_CABLE))
    changes, shifts, reasons = [], [], []
    for place in places:
        over = align(_reduced(place, scale), small, free)
        if isinstance(over, str):
            reasons.append(over)
            continue
        changes.append(change(small, over.place, over.valid, free))
        shifts.append(over.shift_px)
    if not changes:
        return Weighed(probability, 0.0, 0.0, 0.0, reasons[0])
    least = np.min(changes, axis=0)
    added = np.asarray(
        cv2.resize(_added(least, odds, weights), image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    )
    out = np.asarray(1 / (1 + np.exp(-(log_odds(probability) + added))), np.float32)
    cable = (probability >= 0.5) | (out >= 0.5)
    relied = float(np.abs(out - probability)[cable].mean()) if cable.any() else 0.0
    return Weighed(out, float(np.mean(least < _SAME)), relied, float(min(shifts)) / scale)


def _added(change: Float32Array, odds: Float32Array, weights: Weights) -> Float32Array:
    """To the log odds. NaN, where no picture of the place reaches, adds nothing."""
    out = evidence(change, odds) @ np.array(weights, np.float32)
    return np.nan_to_num(np.asarray(out, np.float32), nan=0.0)


def evidence(change: Float32Array, odds: Float32Array) -> Float32Array:
    """(…, 5) what :class:`Weights` weigh."""
    grown = np.log1p(change)
    return np.stack([np.ones_like(grown), grown, grown**2, odds, odds * grown], axis=-1)


class Aligned(NamedTuple):
    """``place`` (h, w, 3) brought over the picture; ``valid`` (h, w) where it reaches; how far the
    middle moved."""

    place: ByteArray
    valid: BoolArray
    shift_px: float


def align(place: ByteArray, image: ByteArray, free: BoolArray) -> Aligned | str:
    """``place`` (h, w, 3) over ``image``, by what they share where ``free`` (h, w) of cables; or
    why that cannot be."""
    fixed, moving = _contrast(image), _contrast(place)
    window = np.where(free, cv2.createHanningWindow(image.shape[1::-1], cv2.CV_32F), np.float32(0))
    (dx, dy), _ = cv2.phaseCorrelate(fixed * window, moving * window)
    most = _FARTHEST * max(image.shape[:2])
    if np.hypot(dx, dy) > most:
        dx = dy = 0.0
    start = np.array([[1, 0, dx], [0, 1, dy]], np.float32)
    found = _refined(fixed, moving, free, start)
    if found is None:
        return "it does not show the same place, or too little of it is free of cables"
    warp, correlation = found
    middle = np.array([image.shape[1] / 2, image.shape[0] / 2])
    shift = float(np.hypot(*(warp[:, :2] @ middle + warp[:, 2] - middle)))
    if correlation < _LEAST_CORRELATION or shift > most:
        return f"it shows another place, or the camera moved by {shift:.0f} px (correlation {correlation:.2f})"
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = image.shape[1::-1]
    over = cv2.warpAffine(place, warp, size, flags=how, borderMode=cv2.BORDER_REPLICATE)
    valid = cv2.warpAffine(np.ones(place.shape[:2], np.uint8), warp, size, flags=how)
    return Aligned(np.asarray(over, np.uint8), valid > 0, shift)


def _refined(
    fixed: Float32Array, moving: Float32Array, free: BoolArray, start: Float32Array
) -> tuple[FloatArray, float] | None:
    """The warp (2, 3) from ``fixed`` to ``moving``, turned and shifted, and the correlation that it
    reaches."""
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 1e-4)
    mask = free.astype(np.uint8) * 255
    best = None
    for first in (start, np.eye(2, 3, dtype=np.float32)):
        try:
            correlation, warp = cv2.findTransformECC(
                fixed, moving, first.copy(), cv2.MOTION_EUCLIDEAN, criteria, mask, 5
            )
        except cv2.error:  # it diverges where nothing is shared
            continue
        if best is None or correlation > best[1]:
            best = np.asarray(warp, np.float64), float(correlation)
        if correlation > 0.8:
            break
    return best


def change(image: ByteArray, place: ByteArray, valid: BoolArray, free: BoolArray) -> Float32Array:
    """(h, w) in usual changes of this pair of pictures, at most 12; NaN where ``place`` does not
    reach. What is usual is measured where the picture is ``free`` of cables."""
    before = _log(place)
    ratio = _log(image) - before
    ratio = np.asarray(cv2.GaussianBlur(ratio - _light(ratio), (0, 0), _SMOOTH_PX), np.float32)
    tone = ratio.mean(axis=2)
    color = np.sqrt(((ratio - tone[:, :, None]) ** 2).sum(axis=2))
    level, known = _levels(_steepness(before), valid & free), valid & free
    parts = [np.abs(part) / _usual(np.abs(part), level, known)[level] for part in (tone, color)]
    out = np.minimum(np.hypot(*parts), _MOST_CHANGE).astype(np.float32)
    out[~valid] = np.nan
    return np.asarray(out)


def _levels(steepness: Float32Array, known: BoolArray) -> IntArray:
    """(h, w) number of the level, each of which holds the same share of ``known``."""
    if not known.any():
        return np.zeros(steepness.shape, np.int64)
    bounds = np.quantile(steepness[known], np.linspace(0, 1, _STEEPNESS_LEVELS + 1)[1:-1])
    return np.asarray(np.searchsorted(bounds, steepness), np.int64)


def _usual(values: Float32Array, level: IntArray, known: BoolArray) -> FloatArray:
    """Standard deviation by level, of most of ``values``."""
    everywhere = float(np.median(values[known])) if known.any() else 0.0
    found = [values[known & (level == k)] for k in range(_STEEPNESS_LEVELS)]
    middle = [float(np.median(v)) if len(v) >= _LEAST_PIXELS else everywhere for v in found]
    return np.maximum(np.array(middle) * _TO_DEVIATION, _LEAST_USUAL)


def _light(ratio: Float32Array) -> Float32Array:
    """What is the same over an area that is wide against a cable: (h, w, 3)."""
    height, width = ratio.shape[:2]
    factor = max(1, round(max(height, width) / 160))
    size = -(-width // factor), -(-height // factor)
    side = 2 * round(_AREA * max(height, width) / factor / 2) + 1
    few = np.asarray(cv2.resize(cv2.medianBlur(ratio, 5), size, interpolation=cv2.INTER_AREA))
    levels = np.clip((few + 2) * 63.75, 0, 255).astype(np.uint8)
    middle = np.stack(
        [cv2.medianBlur(np.ascontiguousarray(levels[:, :, k]), side) for k in range(3)], axis=2
    )
    return np.asarray(
        cv2.resize(middle.astype(np.float32) / 63.75 - 2, (width, height)), np.float32
    )


def _steepness(logs: Float32Array) -> Float32Array:
    """(h, w) change a pixel, the most around."""
    smooth = cv2.GaussianBlur(logs, (0, 0), 0.8)
    dx, dy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0) / 8, cv2.Sobel(smooth, cv2.CV_32F, 0, 1) / 8
    return np.asarray(cv2.dilate(np.hypot(dx, dy), np.ones((3, 3), np.uint8)).mean(axis=2))


def _log(image: ByteArray) -> Float32Array:
    return np.log(cv2.GaussianBlur(image, (0, 0), 0.7).astype(np.float32) / 255 + _DARK)


def _contrast(image: ByteArray) -> Float32Array:
    """(h, w) log brightness against its surroundings, which light hardly changes."""
    logs = np.log(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) / 255 + _DARK)
    return np.clip(logs - cv2.GaussianBlur(logs, (0, 0), _CONTRAST_PX), -0.5, 0.5)


def log_odds(probability: Float32Array) -> Float32Array:
    """Of a probability, which is kept off 0 and 1."""
    p = np.clip(probability, 1e-3, 1 - 1e-3)
    return np.asarray(np.log(p / (1 - p)), np.float32)


def _reduced(values: np.ndarray, scale: float) -> np.ndarray:
    if scale == 1.0:
        return values
    size = round(values.shape[1] * scale), round(values.shape[0] * scale)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA))
