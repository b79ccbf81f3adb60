"""What the chroma key found, drawn: histograms with the ranges, and the mask over the first
pictures."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from models.synthesis.chroma_ranges import ScreenRanges, to_hsv

Rgb = NDArray[np.uint8]
_TILE = (320, 180)  # width, height


def report(
    pictures: Sequence[Rgb], masks: Sequence[NDArray[np.bool_]], ranges: ScreenRanges
) -> Rgb:
    """One picture (RGB): three histograms over all ``pictures``, below them pairs of picture and
    overlay."""
    pixels = np.concatenate([to_hsv(picture)[::2, ::2].reshape(-1, 3) for picture in pictures])
    channels = (
        ("hue", 360.0, ranges.hue_deg),
        ("saturation", 1.0, ranges.saturation),
        ("value", 1.0, ranges.value),
    )
    plots = [_histogram(pixels[:, k], *channel) for k, channel in enumerate(channels)]
    rows = [np.hstack([*plots, np.full((_TILE[1], _TILE[0], 3), 255, np.uint8)])]
    tiles = [tile for pair in zip(pictures, masks, strict=True) for tile in _pair(*pair)]
    tiles += [np.zeros_like(plots[0])] * (-len(tiles) % 4)
    rows += [np.hstack(tiles[k : k + 4]) for k in range(0, len(tiles), 4)]
    return np.vstack(rows)


def _histogram(
    values: NDArray[np.float32], name: str, top: float, bounds: tuple[float, float]
) -> Rgb:
    width, height = _TILE
    plot = np.full((height, width, 3), 255, np.uint8)
    left, right = (int(np.clip(bound / top, 0, 1) * (width - 1)) for bound in bounds)
    plot[:, left : right + 1] = (200, 235, 200)
    counts = np.histogram(values, width, (0.0, top))[0]
    bars = (height - 30) * np.sqrt(
        counts / max(counts.max(), 1)
    )  # root: the DLO's small hills show as well
    for x, bar in enumerate(bars.astype(int)):
        plot[height - bar :, x] = (60, 60, 60)
    text = f"{name} {bounds[0]:.3g} to {bounds[1]:.3g}"
    cv2.putText(plot, text, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return plot


def _pair(picture: Rgb, mask: NDArray[np.bool_]) -> tuple[Rgb, Rgb]:
    overlay = picture // 2
    overlay[mask] = (255, 60, 200)
    plain, marked = (
        np.asarray(cv2.resize(p, _TILE, interpolation=cv2.INTER_AREA), np.uint8)
        for p in (picture, overlay)
    )
    return plain, marked
