"""Which strands belong to a curve, and which views speak for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.reconstruction.refinement import Refined
from models.reconstruction.views import View

Verdict = Literal["used", "not_found", "does_not_fit", "out_of_sight"]

_LEAST_SHARE = 0.08
"""Of the samples near any strand: a strand with fewer does not belong to the curve."""
_FITS = 0.4
"""Share of the samples in a picture that must lie on strands for its view to count."""
_SAME_SHAPE_PX = 4.0
"""A strand that, shifted as a whole, is this near to where the DLO should be is the DLO seen from
another pose."""


@dataclass(frozen=True, eq=False)
class Support:
    """How a view supports a curve: ``strands`` that belong to it, ``share`` of the samples in the
    picture that lie on them, mean distance ``reprojection_px`` of those, and how it ended."""

    verdict: Verdict
    strands: tuple[int, ...]
    share: float
    reprojection_px: float
    off_px: float = 0.0
    """For a view that does not fit: how far its strand is from where the DLO should be."""


def belonging(points_m: FloatArray, view: View, reach_px: float) -> IntArray:
    """Numbers of the view's strands near (n, 3) points of a curve, by majority along it."""
    samples = view.samples
    if not len(samples.xy):
        return np.zeros(0, np.int64)
    xy = np.nan_to_num(view.camera.project(points_m), nan=-1e6)
    distance, nearest = samples.tree.query(xy, distance_upper_bound=reach_px)
    voted = samples.strand[nearest[np.isfinite(distance)]]
    numbers, votes = np.unique(voted, return_counts=True)
    return numbers[votes > _LEAST_SHARE * len(voted)]


def supports(refined: Refined, views: list[View], strands: list[IntArray]) -> list[Support]:
    """One for each view, from the residuals of the refinement."""
    points = refined.spline.at(refined.parameters)
    return [
        _support(view, points, refined.residual_px[k], refined.used[k], strands[k])
        for k, view in enumerate(views)
    ]


def _support(
    view: View, points: FloatArray, residual: FloatArray, used: BoolArray, strands: IntArray
) -> Support:
    xy = np.nan_to_num(view.camera.project(points), nan=-1e6)
    inside = view.camera.sees(xy)
    if inside.sum() < 0.15 * len(points):
        return Support("out_of_sight", (), 0.0, float("nan"))
    share = float((used & inside).sum() / inside.sum())
    if share >= _FITS:
        numbers = tuple(int(k) for k in strands)
        return Support("used", numbers, share, float(np.abs(residual[used]).mean()))
    if not len(view.samples.xy):
        return Support("not_found", (), share, float("nan"))
    off = _shifted(xy[inside], view)
    if off is None:
        return Support("not_found", (), share, float("nan"))
    return Support("does_not_fit", (), share, float("nan"), off)


def _shifted(expected_xy: FloatArray, view: View) -> float | None:
    """By how many pixels a strand of the same shape is off, or None: (n, 2) points are laid onto
    each strand by a shift alone, found by going to the nearest points a few times."""
    for strand in view.strands:
        if strand.length_px < 0.5 * float(np.hypot(*np.diff(expected_xy, axis=0).T).sum()):
            continue
        tree = cKDTree(strand.xy)
        shift = strand.xy.mean(axis=0) - expected_xy.mean(axis=0)
        for _ in range(15):
            _, nearest = tree.query(expected_xy + shift)
            shift = np.median(strand.xy[nearest] - expected_xy, axis=0)
        distance, _ = tree.query(expected_xy + shift)
        if np.median(distance) < _SAME_SHAPE_PX:
            return float(np.hypot(*shift))
    return None


def claimed(points_m: FloatArray, view: View, reach_px: float = 4.0) -> dict[int, float]:
    """Share of each strand of ``view`` that is on a curve of (n, 3) dense points."""
    samples = view.samples
    if not len(samples.xy):
        return {}
    xy = view.camera.project(points_m)
    xy = xy[np.isfinite(xy).all(axis=1)]
    near = np.zeros(len(samples.xy), bool)
    for around in samples.tree.query_ball_point(xy, reach_px):
        near[around] = True
    return {
        int(k): float(near[samples.strand == k].mean()) for k in np.unique(samples.strand[near])
    }
