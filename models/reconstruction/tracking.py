"""Following a DLO from section to section (thesis section 4.5.5): the part that was reconstructed
before tells which strand to go on with, and how deep it is."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray
from models.geometry.cameras import Camera
from models.reconstruction.curves import Curve, distances
from models.reconstruction.views import View

_NEAR_PX = 12.0


def continuing_strand(previous: Curve, views: list[View]) -> tuple[int, int] | None:
    """(view, strand) that follows the most of what is visible of ``previous``, or None if no strand
    does."""
    best, winner = 0.0, None
    dense = previous.spline.at(np.linspace(0, 1, 400))
    for k, view in enumerate(views):
        xy = view.camera.project(dense)
        xy = xy[np.isfinite(xy).all(axis=1)]
        xy = xy[view.camera.sees(xy)]
        if len(xy) < 5 or not len(view.samples.xy):
            continue
        distance, nearest = view.samples.tree.query(xy, distance_upper_bound=_NEAR_PX)
        hit = np.isfinite(distance)
        strands = view.samples.strand[nearest[hit]]
        for strand in np.unique(strands):
            score = float(np.sum(1 - (distance[hit][strands == strand] / _NEAR_PX) ** 2))
            if score > best:
                best, winner = score, (k, int(strand))
    return winner


def expected_depth(previous: Curve, camera: Camera, ideal_xy: FloatArray) -> FloatArray:
    """(n,) depth of (n, 2) pixels that lie on the projection of ``previous``; NaN for the
    others."""
    dense = previous.spline.at(np.linspace(0, 1, 600))
    xy = camera.project(dense)
    seen = np.isfinite(xy).all(axis=1)
    if not seen.any():
        return np.full(len(ideal_xy), np.nan)
    distance, nearest = cKDTree(xy[seen]).query(ideal_xy)
    depth = camera.in_camera(dense[seen][nearest])[:, 2]
    return np.where(distance < _NEAR_PX, depth, np.nan)


def overlap(curve: Curve, previous: Curve) -> float:
    """Share of ``curve`` that is on ``previous``: within 3 mm or three standard deviations."""
    apart = distances(curve.points_m, previous.spline.at(np.linspace(0, 1, 600)))
    return float(np.mean(apart < np.maximum(3e-3, 3 * curve.sigma_m)))


def along(curve: Curve, previous: Curve) -> Curve:
    """``curve`` in the direction of ``previous``: it leaves where ``previous`` ends."""
    dense = previous.spline.at(np.linspace(0, 1, 600))
    tree = cKDTree(dense)
    _, nearest = tree.query(curve.points_m)
    shared = distances(curve.points_m, dense) < 5e-3
    if shared.sum() >= 2:
        order = nearest[shared]
        forward = order[-1] >= order[0]
    else:
        ends = previous.points_m[-1]
        forward = np.linalg.norm(curve.points_m[0] - ends) <= np.linalg.norm(
            curve.points_m[-1] - ends
        )
    return curve if forward else curve.reversed()
