"""Picking points from a mask, and places at another resolution."""

from __future__ import annotations

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

_LEAST_DISTANCE = np.float32(0.5)
"""Between the distance of the background, 0, and that of the outermost foreground, about 1."""


def at_scale(xy: FloatArray | tuple[float, float], scale: float | FloatArray) -> FloatArray:
    """``(…, 2)`` places with ``scale`` pixels for each, one or (x, y): pixel centers are whole
    numbers at any resolution."""
    return np.asarray((np.asarray(xy) + 0.5) * scale - 0.5)


def point_at_scale(xy: tuple[float, float], scale: float | FloatArray) -> tuple[float, float]:
    x, y = at_scale(xy, scale).tolist()
    return x, y


def local_maxima(distances: Float32Array) -> IntArray:
    """``(m, 2)`` points ``(x, y)`` of the foreground that no 8-neighbor exceeds, in row order."""
    if not distances.size:
        return np.zeros((0, 2), np.int64)
    reached = cv2.dilate(distances, np.ones((3, 3), np.uint8))
    np.maximum(reached, _LEAST_DISTANCE, out=reached)
    found = cv2.findNonZero(cv2.compare(distances, reached, cv2.CMP_GE))
    return np.zeros((0, 2), np.int64) if found is None else found.reshape(-1, 2).astype(np.int64)


def farthest_points(points_xy: IntArray, count: int) -> IntArray:
    """Indices ``(count,)`` of farthest-point sampling from ``(m, 2)`` whole-number points, from
    index 0 on.

    Each step takes the point farthest from those taken (the first of equals). ``O(m * count)``
    time. One product a step gives all squared distances: ``|p - q|^2 = (x, y, |p|^2, 1) . (-2x_q,
    -2y_q, 1, |q|^2)``.
    """
    points = points_xy.astype(np.float64)
    squares = np.einsum("ij,ij->i", points, points)
    ones = np.ones(len(points))
    rows = np.stack((points[:, 0], points[:, 1], squares, ones))
    queries = np.stack((-2 * points[:, 0], -2 * points[:, 1], ones, squares), axis=1)
    taken = np.zeros(count, dtype=np.int64)
    nearest = queries[0] @ rows
    latest = np.empty_like(nearest)
    for step in range(1, count):
        index = int(nearest.argmax())
        taken[step] = index
        np.dot(queries[index], rows, out=latest)
        np.minimum(nearest, latest, out=nearest)
    return taken


def thin_to_grid(points_xy: IntArray, at_most: int) -> IntArray:
    """The points, or the first one in each cell of the finest square grid that leaves at most
    ``at_most``."""
    cell = 2
    kept = points_xy
    while len(kept) > at_most:
        cells = points_xy // cell
        _, first = np.unique(cells[:, 1] * (cells[:, 0].max() + 1) + cells[:, 0], return_index=True)
        kept = points_xy[np.sort(first)]
        cell *= 2
    return kept


def middle(values: FloatArray, axis: int) -> FloatArray:
    """The median along an axis, as ``np.median``, which takes three times as long for few
    numbers."""
    count = values.shape[axis]
    ordered = np.sort(values, axis=axis)
    return np.asarray((ordered.take((count - 1) // 2, axis) + ordered.take(count // 2, axis)) / 2)


def read_nearest(image: Float32Array | BoolArray | ByteArray, points_xy: FloatArray) -> FloatArray:
    """Values ``(…,)`` of an ``(H, W)`` array at the pixels nearest to ``(…, 2)`` points, clamped;
    ``(…, C)`` of an ``(H, W, C)`` one."""
    height, width = image.shape[:2]
    nearest = np.rint(points_xy).astype(np.intp)
    np.maximum(nearest, 0, out=nearest)
    place = np.minimum(nearest[..., 1], height - 1)
    place *= width
    place += np.minimum(nearest[..., 0], width - 1)
    return image.reshape(height * width, *image.shape[2:]).take(place, axis=0).astype(np.float64)
