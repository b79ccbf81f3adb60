"""Foreground from height and color together: a shadow has no height; what has height but no color
is still there.

Strategy: a cable is a line that stands out from what is around it, so heights are averaged along
short lines in eight directions: noise is averaged away, a cable is not. The best direction counts,
in units of how far it varies over the bare table. What is wide is ground, however high. Where the
depth has a hole, color alone decides.
"""

from __future__ import annotations

import cv2
import numpy as np

from models.depth.table import Table
from models.geometry.arrays import BoolArray, Float32Array

_LINE_PX, _DIRECTIONS = 15, 8
_LEAST_KNOWN = 0.33
"""Of a line, for its mean to count."""
_SURE, _MOST_LOG_ODDS = 4.0, 4.0
"""So many deviations are as likely a cable as none; every one more or less counts e times, up to so
much."""
_WIDEST_SHARE = 0.1
"""What is wider than this share of the picture's width is no cable, however high."""
_LEAST_SPREAD_M = 5e-5
_HIGHEST_SIGMAS, _HIGHEST_M = 4.0, 0.02
"""Of a single height, below and above the ground, so that a pixel that flies counts little."""
_TABLE_SIGMAS = 6.0
"""What is so little above or below it is the table: the lowest of many noisy heights is far from
their mean."""
_LEAST_PROBABILITY = 1e-4


def log_odds(heights_m: Float32Array, table: Table) -> Float32Array:
    """(H, W) for a cable against none, from ``heights_m`` (H, W) above the table; 0 where nothing
    is known."""
    there = np.isfinite(heights_m)
    above = np.where(there, heights_m, 0).astype(np.float32)
    ground = _ground(above, there, table.sigma_m)
    above = np.where(
        there, np.clip(above - ground, -_HIGHEST_SIGMAS * table.sigma_m, _HIGHEST_M), 0
    )
    lines, counts = _along_lines(above.astype(np.float32), there)
    bare = lines[counts & (np.abs(above) < 3 * table.sigma_m)]
    if not bare.size:
        return np.zeros(heights_m.shape, np.float32)
    middle = float(np.median(bare))
    spread = max(1.4826 * float(np.median(np.abs(bare - middle))), _LEAST_SPREAD_M)
    odds = np.clip((lines - middle) / spread - _SURE, -_MOST_LOG_ODDS, _MOST_LOG_ODDS)
    return np.asarray(np.where(counts, odds, 0.0), np.float32)


def combined(probability: Float32Array, odds: Float32Array) -> Float32Array:
    """(H, W) probability of foreground from that of the color and the height's ``odds``."""
    p = np.clip(probability, _LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY)
    return np.asarray(1.0 / (1.0 + np.exp(-(np.log(p / (1 - p)) + odds))), np.float32)


def alone(odds: Float32Array) -> Float32Array:
    """(H, W) probability of foreground from height alone; single pixels that fly are smoothed
    away."""
    return np.asarray(
        cv2.medianBlur(np.asarray(1.0 / (1.0 + np.exp(-odds)), np.float32), 3), np.float32
    )


def _along_lines(above: Float32Array, there: BoolArray) -> tuple[Float32Array, BoolArray]:
    """(H, W) mean along the best line through each pixel, and where enough is known of one."""
    known = there.astype(np.float32)
    best = np.full(above.shape, -np.inf, np.float32)
    for kernel in _lines():
        count = cv2.filter2D(known, -1, kernel, borderType=cv2.BORDER_REFLECT)
        mean = cv2.filter2D(above, -1, kernel, borderType=cv2.BORDER_REFLECT) / np.maximum(
            count, 1.0
        )
        best = np.maximum(best, np.where(count >= _LEAST_KNOWN * kernel.sum(), mean, -np.inf))
    enough = np.isfinite(best)
    return np.where(enough, best, 0.0).astype(np.float32), enough


def _lines() -> list[Float32Array]:
    half = _LINE_PX // 2
    kernels = []
    for angle in np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
        kernel = np.zeros((_LINE_PX, _LINE_PX), np.float32)
        dx, dy = round(half * float(np.cos(angle))), round(half * float(np.sin(angle)))
        cv2.line(kernel, (half - dx, half - dy), (half + dx, half + dy), (1.0,), 1)
        kernels.append(kernel)
    return kernels


def _ground(above: Float32Array, there: BoolArray, sigma_m: float) -> Float32Array:
    """(H, W) what is below narrow things: the table, or the upper side of what is wide (an
    opening)."""
    side = max(int(_WIDEST_SHARE * above.shape[1]) | 1, 9)
    kernel = np.ones((side, side), np.uint8)
    smooth = cv2.blur(above, (3, 3)) / np.maximum(cv2.blur(there.astype(np.float32), (3, 3)), 1e-3)
    low = cv2.erode(np.where(there, smooth, np.float32(1e6)).astype(np.float32), kernel)
    opened = cv2.dilate(np.where(low < 1e5, low, 0).astype(np.float32), kernel)
    return np.asarray(np.where(np.abs(opened) > _TABLE_SIGMAS * sigma_m, opened, 0.0), np.float32)
