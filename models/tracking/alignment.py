"""Where along a tracked cable an observation is: which way round, from which arc length, and how far off.

Strategy: every point of the observation is projected onto the cable where it is expected. If the observation
is a piece of the cable, the arc length of the projections grows as the observation's own: the median of their
difference is where the piece starts. Free ends are hard facts: an end that was free and is free again is the
same end, whatever the projections are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths, point_at, resample
from models.tracking.state import Observation, TrackedCable

_SAMPLES = 32
_SAME_LENGTH = 0.2
"""Two whole cables whose lengths differ by less than this share may be one."""
_SAME_END = 0.25
"""A free end this share of the length away from the known one may be it."""


class Alignment(NamedTuple):
    """The observation's first point (its last one when ``reverse``) is at arc length ``start`` px of the cable, its
    other end at ``stop``; ``distance`` px on average from where the cable was expected."""

    reverse: bool
    start: float
    stop: float
    distance: float


def align(observed: Observation, cable: TrackedCable, expected: FloatArray) -> Alignment:
    """The better of both ways round; ``expected`` (NODES, 2) where the cable should be in this frame."""
    forward = resample(observed.xy, _SAMPLES)
    ways = [_one_way(observed, cable, expected, reverse, forward) for reverse in (False, True)]
    return min(ways, key=lambda way: way.distance)


def align_part(part: Observation, whole: Alignment, cable: TrackedCable, expected: FloatArray) -> Alignment:
    """Where a part is if the observation that it was cut from is on the cable as ``whole``."""
    first, last = part.span
    if whole.reverse:
        first, last = 1 - last, 1 - first
    length = whole.stop - whole.start
    start, stop = whole.start + first * length, whole.start + last * length
    points = resample(part.xy[::-1] if whole.reverse else part.xy, _SAMPLES)
    return Alignment(whole.reverse, start, stop, _distance(points, start, stop, cable, expected))


def _distance(points: FloatArray, start: float, stop: float, cable: TrackedCable, expected: FloatArray) -> float:
    """Mean distance of ``points``, spread over ``start`` to ``stop`` of the cable, from where they are expected."""
    position = np.clip(np.linspace(start, stop, len(points)), 0.0, cable.length_px)
    away = points - point_at(expected, _lengths(cable, expected), position)
    return float(np.hypot(*away.T).mean())


def _lengths(cable: TrackedCable, expected: FloatArray) -> FloatArray:
    """Arc length of every node. The expected curve is a polygon: a little shorter than the cable itself."""
    lengths = arc_lengths(expected)
    return np.asarray(lengths * (cable.length_px / max(float(lengths[-1]), 1e-9)))


def _one_way(
    observed: Observation, cable: TrackedCable, expected: FloatArray, reverse: bool, points: FloatArray
) -> Alignment:
    if reverse:
        points = points[::-1]
    along = np.linspace(0.0, observed.length_px, _SAMPLES)
    start = float(np.median(_projected(points, expected, _lengths(cable, expected)) - along))
    start, stop = _anchored(start, observed, cable, reverse)
    return Alignment(reverse, start, stop, _distance(points, start, stop, cable, expected))


def _anchored(start: float, observed: Observation, cable: TrackedCable, reverse: bool) -> tuple[float, float]:
    """Start and stop along the cable, moved to its ends where free ends meet."""
    ends = observed.ends[::-1] if reverse else observed.ends
    length, own = cable.length_px, observed.length_px
    first = ends[0] == "free" and cable.ends[0] == "free"
    last = ends[1] == "free" and cable.ends[1] == "free"
    if first and last and abs(own - length) < _SAME_LENGTH * length:
        return 0.0, length
    if first and abs(start) < _SAME_END * length:
        return 0.0, own
    if last and abs(start + own - length) < _SAME_END * length:
        return length - own, length
    return start, start + own


def _projected(points: FloatArray, line: FloatArray, lengths: FloatArray) -> FloatArray:
    """Arc length (n,) of the nearest place on ``line`` to each of ``points`` (n, 2)."""
    starts, legs = line[:-1], np.diff(line, axis=0)
    squared = np.maximum((legs**2).sum(1), 1e-12)
    share = np.clip(((points[:, None] - starts) * legs).sum(2) / squared, 0.0, 1.0)
    away = ((starts + share[..., None] * legs - points[:, None]) ** 2).sum(2)
    nearest = away.argmin(1)
    rows = np.arange(len(points))
    return np.asarray(lengths[nearest] + share[rows, nearest] * np.diff(lengths)[nearest])
