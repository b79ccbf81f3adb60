"""The color of a chroma-key screen, found from its pictures, and the mask of what stands before it
(thesis 2.3.1).

Strategy: on a screen one hue outnumbers all others. The ranges are grown outward from that mode
until the histogram has fallen to a small share of its peak, hue first, then saturation and value
among the pixels of that hue. So an object of another color, however bright, forms a hill of its own
and moves no bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
Mask = NDArray[np.bool_]

GREEN_TO_BLUE_DEG = (70.0, 265.0)
_LEAST_SHARE = 0.5  # of the pixels must be screen
_REACH_DEG = 40.0  # a screen's hues lie this near to their mode
_FADED = (0.18, 0.08)  # below this saturation or value a hue is noise
_SPECK_SHARE = 5e-4  # of a picture; what is smaller is no DLO
_SOFT = 0.025  # saturation and value change by less than this a pixel where a highlight fades
_LARGE_SHARE = 0.02  # of the screen: connected parts of it that highlights may join
_MEDIAN_SIDE, _MEDIAN_CELLS = 96, 21  # the cloth around a DLO: a fifth of the picture's width


class ScreenError(ValueError):
    """The pictures show no screen of one color."""


@dataclass(frozen=True)
class ScreenRanges:
    """Bounds, both included: ``hue_deg`` 0 to 360, ``saturation`` and ``value`` 0 to 1; ``share``
    of the pixels the ranges were found on that lie within."""

    hue_deg: tuple[float, float]
    saturation: tuple[float, float]
    value: tuple[float, float]
    share: float

    def contain(self, hsv: NDArray[np.float32]) -> Mask:
        """Which pixels of ``hsv`` (..., 3) are screen."""
        bounds = np.array([self.hue_deg, self.saturation, self.value], np.float32)
        return np.asarray(((hsv >= bounds[:, 0]) & (hsv <= bounds[:, 1])).all(-1))


def to_hsv(rgb: Rgb) -> NDArray[np.float32]:
    """(H, W, 3) to hue in degrees, saturation and value 0 to 1, after a light smoothing against
    sensor noise."""
    smooth = cv2.GaussianBlur(rgb.astype(np.float32) / 255.0, (3, 3), 0)
    return np.asarray(cv2.cvtColor(smooth, cv2.COLOR_RGB2HSV))


def find_ranges(pictures: Sequence[Rgb]) -> ScreenRanges:
    """Ranges that hold for all ``pictures`` (H, W, 3) of one recording.

    Raises ScreenError with the measured spread when fewer than half of the pixels are of one green
    or blue.
    """
    pixels = np.concatenate([to_hsv(picture)[::2, ::2].reshape(-1, 3) for picture in pictures])
    colored = pixels[(pixels[:, 1] > _FADED[0]) & (pixels[:, 2] > _FADED[1])]
    if len(colored) < _LEAST_SHARE * len(pixels):
        share = len(colored) / max(len(pixels), 1)
        raise ScreenError(f"no colored screen: only {share:.0%} of the pixels have a color at all")
    mode = _hue_mode(colored[:, 0])
    near = colored[np.abs(_turn(colored[:, 0], mode)) <= _REACH_DEG]
    low, high = _hill(_turn(near[:, 0], mode), (-_REACH_DEG, _REACH_DEG), 80, 0.01)
    hue = (mode + low - 2.0, mode + high + 2.0)
    screen = near[(near[:, 0] >= hue[0]) & (near[:, 0] <= hue[1])]
    saturation = _hill(screen[:, 1], (0.0, 1.0), 50, 0.01)
    darkest, brightest = np.quantile(screen[:, 2], (0.005, 0.995))
    # A shadow darkens a screen without changing its hue or saturation; a highlight seldom doubles
    # it.
    value = (0.55 * float(darkest), min(1.2 * float(brightest), 1.0))
    found = ScreenRanges(hue, saturation, value, 0.0)
    share = float(found.contain(pixels).mean())
    _check(share, mode, colored[:, 0])
    return ScreenRanges(hue, saturation, value, share)


def foreground(hsv: NDArray[np.float32], ranges: ScreenRanges) -> Mask:
    """(H, W) what is not screen nor a highlight on it: specks opened away, glints closed,
    components below 0.05 % of the picture left out."""
    screen = ranges.contain(hsv)
    outside = (~(screen | highlights(hsv, ranges, screen))).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(outside, cv2.MORPH_OPEN, kernel)
    closed = cv2.morphologyEx(
        opened, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    )
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= _SPECK_SHARE * closed.size
    large[0] = False
    return np.asarray(large[labels])


def highlights(hsv: NDArray[np.float32], ranges: ScreenRanges, screen: Mask) -> Mask:
    """(H, W) where a lamp mirrors in a glossy screen and its color fades to white.

    Strategy: a highlight fades softly into the screen around it; a white DLO has an edge. What is
    bright and pale is taken for screen where it is linked to a large part of the screen without a
    step.
    """
    saturation, value = hsv[..., 1], hsv[..., 2]
    if not screen.any():
        return np.zeros_like(screen)
    pale = (saturation < ranges.saturation[0] + 0.03) & (value > np.median(value[screen]))
    pale = cv2.morphologyEx(pale.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    soft = _steepness(hsv[..., 1:]) < _SOFT
    _, parts = cv2.connectedComponents(((pale | screen) & soft).astype(np.uint8), connectivity=4)
    of_screen = np.bincount(parts[screen], minlength=int(parts.max()) + 1)
    large = of_screen >= _LARGE_SHARE * np.count_nonzero(screen)
    large[0] = False
    linked = (large[parts] & pale & soft).astype(np.uint8)
    return np.asarray((cv2.dilate(linked, np.ones((5, 5), np.uint8)) > 0) & pale)


def _steepness(channels: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) how much (H, W, C) values change a pixel, over a few pixels."""
    smooth = cv2.GaussianBlur(channels, (0, 0), 2.0)
    across, down = (
        cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3, scale=1 / 8) for order in ((1, 0), (0, 1))
    )
    return np.asarray(np.sqrt((across**2 + down**2).reshape(channels.shape).sum(-1)))


def of_screen_hue(hsv: NDArray[np.float32], ranges: ScreenRanges) -> float:
    """Share of the picture that has the screen's hue and yet is not screen: a DLO of that hue
    stands out from the cloth around it by its saturation, with an edge; where light and shadow
    change, saturation changes slowly."""
    hue, saturation, value = (np.ascontiguousarray(hsv[..., k]) for k in range(3))
    colored = (hue >= ranges.hue_deg[0]) & (hue <= ranges.hue_deg[1]) & (saturation > _FADED[0])
    colored &= value > max(ranges.value[0], _FADED[1])
    if not colored.any():
        return 0.0
    cloth = np.where(colored, saturation, np.median(saturation[colored]))
    odd = (colored & (np.abs(saturation - _around(cloth)) > 0.12)).astype(np.uint8)
    opened = cv2.morphologyEx(odd, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, parts, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    rim = parts * (opened > cv2.erode(opened, np.ones((3, 3), np.uint8), borderValue=1))
    steep = np.bincount(rim.ravel(), _steepness(hsv[..., 1:2]).ravel(), count)
    areas = stats[:, cv2.CC_STAT_AREA]
    seen = (areas >= _SPECK_SHARE * opened.size) & (
        steep > _SOFT * np.bincount(rim.ravel(), minlength=count)
    )
    return float(areas[1:][seen[1:]].sum() / opened.size)


def _around(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) median of the values in a wide surrounding, 0 to 1."""
    height, width = values.shape
    factor = _MEDIAN_SIDE / max(height, width)
    small = cv2.resize(
        values,
        (max(round(width * factor), 1), max(round(height * factor), 1)),
        interpolation=cv2.INTER_AREA,
    )
    levels = cv2.medianBlur(np.rint(small * 255).astype(np.uint8), _MEDIAN_CELLS)
    return np.asarray(
        cv2.resize(levels.astype(np.float32) / 255, (width, height), interpolation=cv2.INTER_LINEAR)
    )


def _turn(hue_deg: NDArray[np.float32], origin: float) -> NDArray[np.float32]:
    """Signed angle from ``origin``, -180 to 180."""
    return np.asarray((hue_deg - origin + 180.0) % 360.0 - 180.0)


def _hue_mode(hue_deg: NDArray[np.float32]) -> float:
    counts = np.histogram(hue_deg, 180, (0.0, 360.0))[0].astype(float)
    smooth = sum(
        np.roll(counts, k) * weight for k, weight in zip(range(-2, 3), (1, 2, 3, 2, 1), strict=True)
    )
    return 2.0 * float(np.argmax(smooth)) + 1.0


def _hill(
    values: NDArray[np.float32], span: tuple[float, float], bins: int, foot: float
) -> tuple[float, float]:
    """Where the hill around the histogram's peak has fallen to ``foot`` of its height, left and
    right."""
    counts, edges = np.histogram(values, bins, span)
    smooth = np.convolve(counts, np.ones(3) / 3, "same")
    peak = int(np.argmax(smooth))
    low = smooth <= foot * smooth[peak]
    left = np.flatnonzero(low[:peak])
    right = np.flatnonzero(low[peak:])
    first = left[-1] + 1 if len(left) else 0
    last = peak + right[0] if len(right) else bins
    return float(edges[first]), float(edges[last])


def _check(share: float, mode: float, hue_deg: NDArray[np.float32]) -> None:
    spread = float(np.subtract(*np.quantile(_turn(hue_deg, mode), (0.9, 0.1))))
    measured = f"the commonest hue is {mode:.0f}°, hues spread over {spread:.0f}° (middle 80 %), {share:.0%} is screen"
    if share < _LEAST_SHARE:
        raise ScreenError(
            f"the screen is not one color: {measured}; {_LEAST_SHARE:.0%} or more must be"
        )
    if not GREEN_TO_BLUE_DEG[0] <= mode <= GREEN_TO_BLUE_DEG[1]:
        raise ScreenError(f"the screen is neither green nor blue: {measured}")
