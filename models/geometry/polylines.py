"""Polylines: arrays of points joined in order, ``(n, 2)`` pixels ``(x, y)`` unless stated
otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray, IntArray


class Intersections(NamedTuple):
    """Where segments cross: indices of both segments, how far along each (0 to 1), and the
    point."""

    first: IntArray
    second: IntArray
    along_first: FloatArray
    along_second: FloatArray
    xy: FloatArray


def arc_lengths(points: FloatArray) -> FloatArray:
    """Length from the first of ``(n, d)`` points to every point, ``(n,)``; the last entry is the
    whole length."""
    steps = points[1:] - points[:-1]
    lengths = np.zeros(len(points))
    np.cumsum(np.sqrt(np.einsum("ij,ij->i", steps, steps)), out=lengths[1:])
    return lengths


def resample(points: FloatArray, count: int) -> FloatArray:
    """``count`` points at equal arc length along a polyline of ``(n, d)`` points, both ends
    included."""
    lengths = arc_lengths(points)
    wanted = np.linspace(0.0, lengths[-1], count)
    return np.stack([np.interp(wanted, lengths, axis) for axis in points.T], axis=1)


def resample_each(lines: Sequence[FloatArray], counts: IntArray) -> FloatArray:
    """:func:`resample` of several polylines at once, one after the other: ``(counts.sum(), 2)``,
    ``counts`` (n,) of at least 2."""
    sizes = np.array([len(line) for line in lines])
    points = np.concatenate(lines)
    steps = np.hypot(*np.diff(points, axis=0).T)
    last = np.cumsum(sizes) - 1
    steps[last[:-1]] = 1.0
    along = np.append(0.0, np.cumsum(steps))
    start, stop = along[last - sizes + 1], along[last]
    place = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    share = place / np.repeat(counts - 1, counts)
    wanted = np.repeat(start, counts) + share * np.repeat(stop - start, counts)
    return np.stack([np.interp(wanted, along, axis) for axis in points.T], axis=1)


def point_at(points_xy: FloatArray, lengths: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points at the arc lengths ``wanted``; outside the polyline its nearest end."""
    return np.stack([np.interp(wanted, lengths, axis) for axis in points_xy.T], axis=-1)


def around(points_xy: FloatArray, u: float, reach_px: float) -> FloatArray:
    """``(9, 2)`` points from ``reach_px`` before to ``reach_px`` after the place ``u``, 0 to 1."""
    lengths = arc_lengths(points_xy)
    at = u * lengths[-1]
    return point_at(points_xy, lengths, np.linspace(at - reach_px, at + reach_px, 9))


def bridge(
    starts_xy: FloatArray,
    stops_xy: FloatArray,
    leaving: FloatArray,
    arriving: FloatArray,
    shares: FloatArray,
) -> FloatArray:
    """``(n, s, 2)`` points at the ``shares`` (0 to 1) of cubic curves between ``(n, 2)`` places.

    ``leaving``, ``arriving``: ``(n, 2)`` unit directions of the curves at their starts and stops.
    """
    way = stops_xy - starts_xy
    length = np.hypot(way[:, 0], way[:, 1])[:, None]
    square, cube = shares * shares, shares * shares * shares
    # Hermite's polynomials, (s, 4), and what they weigh, (n, 4, 2).
    shapes = np.stack(
        (
            2 * cube - 3 * square + 1,
            cube - 2 * square + shares,
            3 * square - 2 * cube,
            cube - square,
        ),
        axis=1,
    )
    weighed = np.stack((starts_xy, length * leaving, stops_xy, length * arriving), axis=1)
    out: FloatArray = shapes @ weighed
    return out


def crossing_segments(starts_xy: FloatArray, ends_xy: FloatArray) -> Intersections:
    """All pairs of properly crossing segments, ``first < second``; ``O(S)`` memory for well-spread
    segments.

    Segments that share an end point or are parallel do not cross. Strategy: two segments can only
    meet if their middles are nearer than the longest segment, so a k-d tree of the middles proposes
    the pairs.
    """
    steps = ends_xy - starts_xy
    reach = float(np.hypot(*steps.T).max(initial=0.0))
    pairs = cKDTree((starts_xy + ends_xy) / 2).query_pairs(reach + 1e-9, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int64)
    i, j = pairs.T
    t, u, hit = _meetings(starts_xy[i], steps[i], starts_xy[j], steps[j])
    i, j, t, u = i[hit], j[hit], t[hit], u[hit]
    return Intersections(i, j, t, u, starts_xy[i] + t[:, None] * steps[i])


def segments(
    parts: tuple[tuple[int, FloatArray], ...],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Starts and ends ``(m, 2)`` of all segments of numbered polylines, and each one's number
    ``(m,)``."""
    lines = [(k, xy) for k, xy in parts if len(xy) > 1]
    if not lines:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    starts, ends = (
        np.concatenate([xy[:-1] for _, xy in lines]),
        np.concatenate([xy[1:] for _, xy in lines]),
    )
    return starts, ends, np.repeat([float(k) for k, _ in lines], [len(xy) - 1 for _, xy in lines])


def intersections(
    first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Indices of the segments of both sets that cross, and where ``(c, 2)``; all pairs at once."""
    (p, p2), (q, q2) = first, second
    if not len(p) or not len(q):
        return np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2))
    t, _, hit = _meetings(p[:, None], (p2 - p)[:, None], q, q2 - q)
    i, j = np.nonzero(hit)
    return i, j, p[i] + t[i, j][:, None] * (p2 - p)[i]


def paired_intersections(
    first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
) -> tuple[IntArray, FloatArray]:
    """Rows in which segment k of the first set crosses segment k of the second, and where ``(c,
    2)``."""
    (p, p2), (q, q2) = first, second
    t, _, hit = _meetings(p, p2 - p, q, q2 - q)
    met = np.flatnonzero(hit)
    return met, p[met] + t[met, None] * (p2 - p)[met]


def _meetings(
    p: FloatArray, r: FloatArray, q: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """How far along two segments each, from ``p`` by ``r`` and from ``q`` by ``s``, ``(…, 2)``,
    their lines meet, and whether both segments are there; parallel ones do not meet."""
    area = _cross(r, s)
    safe = np.where(area == 0, 1.0, area)
    t, u = _cross(q - p, s) / safe, _cross(q - p, r) / safe
    return t, u, (area != 0) & (t >= 0) & (t < 1) & (u >= 0) & (u < 1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
