"""Semi-global matching on census cost (Hirschmüller), the baseline of thesis Fig. 4.8, in a few
lines of NumPy."""

from __future__ import annotations

import cv2
import numpy as np

_WINDOW = 5
_P1, _P2 = 3.0, 12.0


def disparity(left: np.ndarray, right: np.ndarray, at_most: int) -> np.ndarray:
    """(H, W) float disparity of ``left`` (H, W) gray uint8: the pixel stands ``d`` to the left in
    ``right``; NaN where the check from right to left fails. Eight paths would cost twice as much as
    these four."""
    cost = _cost(_census(left), _census(right), at_most)
    total = np.zeros_like(cost)
    for axis in (0, 1):
        for step in (1, -1):
            total += _path(cost, axis, step)
    best = total.argmin(axis=2)
    fine = _subpixel(total, best)
    columns = np.arange(left.shape[1])
    back = np.clip(columns[None] - best, 0, left.shape[1] - 1)
    of_right = _right_best(total, at_most)
    agrees = np.abs(np.take_along_axis(of_right, back, axis=1) - best) <= 1
    return np.where(agrees, fine, np.nan)


def opencv(left: np.ndarray, right: np.ndarray, at_most: int) -> np.ndarray:
    """OpenCV's variant of it (Birchfield-Tomasi cost, full passes), with its usual parameters."""
    matcher = cv2.StereoSGBM_create(
        0,
        at_most,
        5,
        P1=200,
        P2=800,
        disp12MaxDiff=1,
        uniquenessRatio=5,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    found = matcher.compute(left, right).astype(np.float64) / 16
    return np.where(found > 0, found, np.nan)


def _census(gray: np.ndarray) -> np.ndarray:
    half = _WINDOW // 2
    padded = np.pad(gray, half, mode="edge")
    bits = np.zeros(gray.shape, np.uint32)
    for dy in range(_WINDOW):
        for dx in range(_WINDOW):
            if (dy, dx) != (half, half):
                shifted = padded[dy : dy + gray.shape[0], dx : dx + gray.shape[1]]
                bits = (bits << np.uint32(1)) | (shifted < gray)
    return bits


def _cost(left: np.ndarray, right: np.ndarray, at_most: int) -> np.ndarray:
    cost = np.full((*left.shape, at_most), float(_WINDOW**2), np.float32)
    for d in range(at_most):
        differing = np.bitwise_count(left[:, d:] ^ right[:, : left.shape[1] - d])
        cost[:, d:, d] = differing
    return cost


def _path(cost: np.ndarray, axis: int, step: int) -> np.ndarray:
    lines = np.moveaxis(cost, axis, 0)[::step]
    out = np.empty_like(lines)
    before = out[0] = lines[0]
    for k in range(1, len(lines)):
        least = before.min(axis=1, keepdims=True)
        nearby = np.pad(before, ((0, 0), (1, 1)), constant_values=np.inf)
        jump = np.minimum(np.minimum(nearby[:, :-2], nearby[:, 2:]) + _P1, least + _P2)
        before = out[k] = lines[k] + np.minimum(before, jump) - least
    return np.moveaxis(out[::step], 0, axis)


def _subpixel(total: np.ndarray, best: np.ndarray) -> np.ndarray:
    inner = np.clip(best, 1, total.shape[2] - 2)[..., None]
    low, middle, high = (np.take_along_axis(total, inner + k, axis=2)[..., 0] for k in (-1, 0, 1))
    curvature = low - 2 * middle + high
    shift = np.where(curvature > 1e-6, (low - high) / np.maximum(2 * curvature, 1e-6), 0.0)
    return inner[..., 0] + np.clip(shift, -0.5, 0.5)


def _right_best(total: np.ndarray, at_most: int) -> np.ndarray:
    width = total.shape[1]
    seen_from_right = np.full_like(total, np.inf)
    for d in range(at_most):
        seen_from_right[:, : width - d, d] = total[:, d:, d]
    return seen_from_right.argmin(axis=2)
