"""Random section shapes for synthetic harnesses (thesis 6.5.1), and where they come near each
other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths, crossing_segments, resample

STEP_PX = 3.0
"""Spacing of the points of every true centerline."""


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two sections (indices ``a <= b``) cross at ``xy``, at these arc lengths; ``sine`` of their
    angle."""

    a: int
    b: int
    at_a: float
    at_b: float
    xy: FloatArray
    sine: float


def wander(
    rng: np.random.Generator,
    start: FloatArray,
    heading: float,
    length: float,
    radius: float,
    turn: float = 0.0,
) -> FloatArray:
    """``(m, 2)`` points from ``start`` on: curvature drifts smoothly and never bends below
    ``radius``.

    ``turn``: a curvature in units of ``1 / radius`` that the first third keeps to, for branches
    that swing out.
    """
    count = max(4, round(length / STEP_PX) + 1)
    knots = max(3, round(length / (3 * radius)) + 2)
    drift = np.clip(rng.normal(0, 0.45, knots), -1, 1)
    if rng.random() < 0.12:
        drift[:] = rng.choice([-1, 1]) * rng.uniform(
            0.5, 0.9
        )  # goes round: a self-crossing where it is long enough
    drift[0] = turn
    curvature = np.interp(np.linspace(0, knots - 1, count), np.arange(knots), drift) / radius
    headings = heading + np.concatenate(([0.0], np.cumsum(curvature[:-1] * STEP_PX)))
    steps = STEP_PX * np.stack((np.cos(headings), np.sin(headings)), axis=1)
    return start + np.concatenate((np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)))


def bezier(
    start: FloatArray, pull_start: FloatArray, pull_end: FloatArray, end: FloatArray
) -> FloatArray:
    """``(m, 2)`` points of a cubic Bézier curve at equal spacing."""
    t = np.linspace(0, 1, 200)[:, None]
    raw = (
        (1 - t) ** 3 * start
        + 3 * t * (1 - t) ** 2 * pull_start
        + 3 * t**2 * (1 - t) * pull_end
        + t**3 * end
    )
    return resample(raw, max(4, round(float(arc_lengths(raw)[-1]) / STEP_PX) + 1))


def sharpest_radius(points_xy: FloatArray) -> float:
    """The smallest bend radius along an evenly spaced polyline."""
    steps = np.diff(points_xy, axis=0)
    angles = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    worst = float(np.abs(np.diff(angles)).max(initial=1e-9))
    return float(np.hypot(*steps[0])) / worst


def meetings(curves: list[FloatArray]) -> list[Meeting]:
    """Every proper crossing of the curves, also of one with itself."""
    owner = np.repeat(np.arange(len(curves)), [len(c) - 1 for c in curves])
    starts, ends = np.concatenate([c[:-1] for c in curves]), np.concatenate([c[1:] for c in curves])
    offsets = np.concatenate([arc_lengths(c)[:-1] for c in curves])
    steps = ends - starts
    sizes = np.hypot(*steps.T)
    found = []
    for i, j, t, u, xy in zip(*crossing_segments(starts, ends), strict=True):
        sine = abs(float(steps[i, 0] * steps[j, 1] - steps[i, 1] * steps[j, 0])) / (
            sizes[i] * sizes[j]
        )
        at_a, at_b = float(offsets[i] + t * sizes[i]), float(offsets[j] + u * sizes[j])
        found.append(Meeting(int(owner[i]), int(owner[j]), at_a, at_b, xy, float(sine)))
    return found


def near_pairs(one: FloatArray, other: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Arc lengths ``(k,)`` on both curves of all pairs of points nearer than ``reach``."""
    pairs = cKDTree(one).sparse_distance_matrix(cKDTree(other), reach, output_type="coo_matrix")
    return STEP_PX * pairs.row.astype(np.float64), STEP_PX * pairs.col.astype(np.float64)
