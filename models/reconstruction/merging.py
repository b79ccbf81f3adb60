"""Sections of one DLO to one filtered curve (thesis section 4.5.5): local regression, as LOWESS.

Strategy: the sections are laid behind one another along a common arc length: each is projected onto what lies there
already and adds what reaches beyond it. At every place of the result a parabola is fitted to the points around it,
weighted by nearness (tricube), by their stated uncertainty, and by how well they fitted the last time (bisquare).
A parabola where LOWESS has a line: a line cuts the bends. Points of one section err together, those of different
sections apart: the covariance of the result adds up by the share each section has in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths, resample
from models.reconstruction import curves
from models.reconstruction.curves import Curve
from models.reconstruction.refinement import across
from models.reconstruction.tracking import along as in_direction_of

_LEAST_WEIGHT = 1e-4
"""Of an outlier: where there is nothing else, the curve still goes on."""


@dataclass(frozen=True)
class MergeParams:
    """``window_m``: length of DLO a local fit sees; ``spacing_m`` between points of the result; ``rounds`` of the
    bisquare weights; ``far_m``: sections farther apart than this are not of one DLO."""

    window_m: float = 0.03
    spacing_m: float = 0.005
    rounds: int = 3
    far_m: float = 0.05


@dataclass(frozen=True, eq=False)
class Merged:
    """``disagreement_m``: mean distance of the sections' points from the curve; ``outliers``: points of weight 0."""

    curve: Curve
    disagreement_m: float
    outliers: int


class NotOneDlo(ValueError):
    """A section does not continue the others; ``section`` is its number."""

    def __init__(self, section: int, gap_m: float) -> None:
        super().__init__(f"lies {1000 * gap_m:.0f} mm from the sections before it: it is not of the same DLO")
        self.section = section


def merge(sections: list[Curve], params: MergeParams) -> Merged:
    """Sections in the order of the scan; the direction of each may be either. Raises NotOneDlo."""
    placed, place = _laid_out(sections, params)
    section = np.repeat(np.arange(len(placed)), [len(c.points_m) for c in placed])
    points = np.concatenate([c.points_m for c in placed])
    covariance = np.concatenate([c.covariance_m2 for c in placed])
    trust = 1 / (np.trace(covariance, axis1=1, axis2=2) + 1e-10)
    order = np.argsort(place, kind="stable")
    place, points, covariance = place[order], points[order], covariance[order]
    trust, section = trust[order], section[order]
    at = np.linspace(place[0], place[-1], max(int(np.ptp(place) / params.spacing_m) + 1, 4))
    robust = np.ones(len(points))
    for _ in range(params.rounds):
        fitted, shares = _local_fit(place, points, trust * np.maximum(robust, _LEAST_WEIGHT), at, params.window_m)
        off = curves.distances(points, fitted)
        scale = 6 * max(float(np.median(off)), 1e-6)
        robust = np.clip(1 - (off / scale) ** 2, 0, 1) ** 2
    spread = _spread(covariance, shares, section, len(placed))
    curve = _as_curve(fitted, spread, placed)
    return Merged(curve, float(off[robust > 0].mean()), int(np.sum(robust == 0)))


def _laid_out(sections: list[Curve], params: MergeParams) -> tuple[list[Curve], FloatArray]:
    """The sections, all in the direction of the first, and the arc length (n,) of all their points; it counts from
    where the first section begins, and is negative for what lies before."""
    placed, places = [sections[0]], [arc_lengths(sections[0].points_m)]
    backbone, origin = sections[0].points_m, 0.0
    for number, section in enumerate(sections[1:], start=1):
        turned = in_direction_of(section, placed[-1])
        gap = float(curves.distances(turned.points_m, backbone).min())
        if gap > params.far_m:
            raise NotOneDlo(number, gap)
        place = _project(turned.points_m, backbone) + origin
        before = place < origin
        after = place > origin + arc_lengths(backbone)[-1]
        backbone = np.concatenate([turned.points_m[before], backbone, turned.points_m[after]])
        origin = min(origin, float(place.min()))
        placed.append(turned)
        places.append(place)
    return placed, np.concatenate(places)


def _project(points: FloatArray, backbone: FloatArray) -> FloatArray:
    """(n,) arc length of (n, 3) points in order along the backbone; beyond its end they count on."""
    along = arc_lengths(backbone)
    own = arc_lengths(points)
    fine = np.linspace(0, along[-1], max(10 * len(backbone), 200))
    dense = resample(backbone, len(fine))
    distance, nearest = cKDTree(dense).query(points)
    inner = (nearest > 0) & (nearest < len(dense) - 1)
    place = fine[nearest]
    touching = np.flatnonzero(inner)
    if not len(touching):
        near_end = nearest[0] == len(dense) - 1
        return along[-1] + distance[0] + own if near_end else own - own[-1] - distance[-1]
    first, last = touching[0], touching[-1]
    place[last + 1 :] = place[last] + own[last + 1 :] - own[last]
    place[:first] = place[first] - (own[first] - own[:first])
    return place


def _local_fit(
    place: FloatArray, points: FloatArray, weight: FloatArray, at: FloatArray, window: float
) -> tuple[FloatArray, FloatArray]:
    """(q, 3) values of local parabolas at (q,) places, and (q, n) the share of each point in them.

    Where the window holds fewer than six points it is widened to them."""
    apart = np.abs(at[:, None] - place[None])
    count = min(6, len(place))
    half = np.maximum(np.partition(apart, count - 1, axis=1)[:, count - 1] * 1.01, window / 2)[:, None]
    kernel = np.clip(1 - (apart / half) ** 3, 0, 1) ** 3 * weight[None]
    kernel /= np.maximum(kernel.sum(axis=1, keepdims=True), 1e-300)
    offset = (place[None] - at[:, None]) / half
    powers = np.stack([np.ones_like(offset), offset, offset**2], axis=2)
    normal = np.einsum("qn,qni,qnj->qij", kernel, powers, powers) + 1e-9 * np.eye(3)
    first = np.linalg.solve(normal, np.eye(3)[None, :, :1].repeat(len(at), axis=0))[..., 0]
    shares = kernel * np.einsum("qni,qi->qn", powers, first)
    shares /= shares.sum(axis=1, keepdims=True)
    return shares @ points, shares


def _spread(covariance: FloatArray, shares: FloatArray, section: IntArray, count: int) -> FloatArray:
    """(q, 3, 3): per section its share squared times its mean covariance there."""
    total = np.zeros((len(shares), 3, 3))
    for k in range(count):
        mine = np.abs(shares[:, section == k])
        weight = mine.sum(axis=1)
        mean = np.einsum("qn,nij->qij", mine / np.maximum(weight, 1e-12)[:, None], covariance[section == k])
        share = np.minimum(np.abs(shares[:, section == k].sum(axis=1)), 1.0)
        total += share[:, None, None] ** 2 * mean
    return total


def _as_curve(points: FloatArray, spread: FloatArray, placed: list[Curve]) -> Curve:
    spans = max(3, min(len(points) // 2, 120))
    spline = curves.fit(points, spans, smooth=1e-6)
    along = arc_lengths(points)
    tangents = spline.tangents(along / along[-1])
    radii = np.array([c.mean_radius_m for c in placed])
    known = radii[np.isfinite(radii)]
    radius = float(np.median(known)) if len(known) else float("nan")
    sigmas = np.array([c.radius_sigma_m for c in placed])
    stated = sigmas[np.isfinite(sigmas)]
    sigma = float(stated.mean() / np.sqrt(len(stated))) if len(stated) else float("nan")
    return Curve(spline, points, across(spread, tangents), np.full(len(points), radius), sigma)
