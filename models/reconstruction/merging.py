"""Sections of one DLO to one filtered curve (thesis section 4.5.5): local regression, as LOWESS.

Strategy: the sections are laid behind one another along a common arc length: each is projected onto
what is there already and adds what reaches beyond it. At every place of the result a parabola is
fitted to the points around it, weighted by nearness (tricube), by their stated uncertainty, and by
how well they fitted the last time (bisquare). A parabola where LOWESS has a line: a line cuts the
bends. Points of one section err together, those of different sections apart: the covariance of the
result adds up by the share each section has in it.

Symbols: K sections, n points of all of them in order of their place, q places of the result, w
pairs of a place and a point in its window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths, resample
from models.reconstruction import curves
from models.reconstruction.curves import Curve
from models.reconstruction.refinement import across
from models.reconstruction.tracking import along as in_direction_of

_LEAST_WEIGHT = 1e-4
"""Of an outlier: where there is nothing else, the curve still goes on."""
_FEWEST = 6
"""Points of a local fit: its window is widened to them."""
_MOST_PAIRS = 4_000_000
_MOST_FINE = 50_000
_SHORTEST_M = 1e-6


@dataclass(frozen=True)
class MergeParams:
    """``window_m``: length of DLO a local fit sees; ``spacing_m`` between points of the result, of
    which there are at most ``points``; ``coarser``: more would be needed, so they are farther
    apart. ``rounds`` of the bisquare weights; ``far_m``: sections farther apart than this are not
    of one DLO."""

    window_m: float = 0.03
    spacing_m: float = 0.005
    points: int = 5000
    coarser: bool = True
    rounds: int = 3
    far_m: float = 0.05


@dataclass(frozen=True, eq=False)
class Merged:
    """``disagreement_m``: mean distance of the sections' points from the curve; ``outliers``:
    points of weight 0."""

    curve: Curve
    disagreement_m: float
    outliers: int


class NotMergeable(ValueError):
    """The sections make no curve, or none of the size that was asked for. ``about``: ``spacing_m``,
    ``window_m`` or ``curves``; ``section``: the number of one that does not continue the others."""

    def __init__(self, message: str, about: str = "curves", section: int | None = None) -> None:
        super().__init__(message)
        self.about = about
        self.section = section


def merge(sections: list[Curve], params: MergeParams) -> Merged:
    """Sections in the order of the scan; the direction of each may be either. Raises
    NotMergeable."""
    placed, place = _laid_out(sections, params)
    section = np.repeat(np.arange(len(placed)), [len(c.points_m) for c in placed])
    points = np.concatenate([c.points_m for c in placed])
    covariance = np.concatenate([c.covariance_m2 for c in placed])
    trust = 1 / (np.trace(covariance, axis1=1, axis2=2) + 1e-10)
    order = np.argsort(place, kind="stable")
    place, points, covariance = place[order], points[order], covariance[order]
    trust, section = trust[order], section[order]
    at = np.linspace(place[0], place[-1], _count(float(np.ptp(place)), params))
    windows = _Windows.around(at, place, params.window_m)
    robust = np.ones(len(points))
    for _ in range(params.rounds):
        fitted, shares = _local_fit(windows, points, trust * np.maximum(robust, _LEAST_WEIGHT))
        off = curves.distances(points, fitted)
        scale = 6 * max(float(np.median(off)), 1e-6)
        robust = np.clip(1 - (off / scale) ** 2, 0, 1) ** 2
    spread = _spread(covariance, shares, section, len(placed))
    curve = _as_curve(fitted, spread, placed)
    return Merged(curve, float(off[robust > 0].mean()), int(np.sum(robust == 0)))


def _laid_out(sections: list[Curve], params: MergeParams) -> tuple[list[Curve], FloatArray]:
    """The sections, all in the direction of the first, and the arc length (n,) of all their points;
    it counts from where the first section begins, and is negative for what is before."""
    placed, places = [sections[0]], [arc_lengths(sections[0].points_m)]
    backbone, origin = sections[0].points_m, 0.0
    for number, section in enumerate(sections[1:], start=1):
        turned = in_direction_of(section, placed[-1])
        gap = float(curves.distances(turned.points_m, backbone).min())
        if gap > params.far_m:
            text = (
                f"lies {1000 * gap:.0f} mm from the sections before it: it is not of the same DLO"
            )
            raise NotMergeable(text, section=number)
        place = _project(turned.points_m, backbone) + origin
        before = place < origin
        after = place > origin + arc_lengths(backbone)[-1]
        backbone = np.concatenate([turned.points_m[before], backbone, turned.points_m[after]])
        origin = min(origin, float(place.min()))
        placed.append(turned)
        places.append(place)
    return placed, np.concatenate(places)


def _project(points: FloatArray, backbone: FloatArray) -> FloatArray:
    """(n,) arc length of (n, 3) points in order along the backbone; beyond its end they count
    on."""
    along = arc_lengths(backbone)
    own = arc_lengths(points)
    fine = np.linspace(0, along[-1], int(np.clip(10 * len(backbone), 200, _MOST_FINE)))
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


def _count(length_m: float, params: MergeParams) -> int:
    """Points of the result."""
    wanted = int(min(length_m / params.spacing_m, 1e9)) + 1
    if wanted > params.points and not params.coarser:
        least = length_m / (params.points - 1)
        text = f"makes {wanted} points of {length_m:.3g} m, at most {params.points}: give {least:.3g} or more"
        raise NotMergeable(text, "spacing_m")
    return max(min(wanted, params.points), 4)


@dataclass(frozen=True, eq=False)
class _Windows:
    """``first`` (q + 1,): pairs ``first[i]`` to ``first[i + 1]`` are those of place i; ``point``
    (w,) the number of each pair's point, ``offset`` (w,) its distance from the place in half
    windows, -1 to 1; ``points`` n."""

    first: IntArray
    point: IntArray
    offset: FloatArray
    points: int

    @classmethod
    def around(cls, at: FloatArray, place: FloatArray, window_m: float) -> _Windows:
        """Of ``place`` (n,) in order around ``at`` (q,). Raises NotMergeable for more pairs than
        memory should hold."""
        farthest = cKDTree(place[:, None]).query(at[:, None], k=[min(_FEWEST, len(place))])[0][:, 0]
        half = np.maximum(farthest * 1.01, window_m / 2)
        begin, end = (
            np.searchsorted(place, at - half, "left"),
            np.searchsorted(place, at + half, "right"),
        )
        counts = end - begin
        if counts.sum() > _MOST_PAIRS:
            text = f"holds {counts.mean():.0f} points on average: {len(at)} such fits are too many, make it smaller"
            raise NotMergeable(text, "window_m")
        first = np.concatenate(([0], np.cumsum(counts)))
        row = np.repeat(np.arange(len(at)), counts)
        point = np.arange(first[-1]) - first[row] + begin[row]
        return cls(first, point, (place[point] - at[row]) / half[row], len(place))

    @property
    def row(self) -> IntArray:
        """(w,) the number of each pair's place."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    def sums(self, values: FloatArray) -> FloatArray:
        """(q,) of (w,) values over each window; none is empty."""
        return np.asarray(np.add.reduceat(values, self.first[:-1]))


def _local_fit(
    windows: _Windows, points: FloatArray, weight: FloatArray
) -> tuple[FloatArray, csr_array]:
    """(q, 3) values of local parabolas, and (q, n) the share of each point in them."""
    offset, row = windows.offset, windows.row
    kernel = np.clip(1 - np.abs(offset) ** 3, 0, 1) ** 3 * weight[windows.point]
    kernel /= np.maximum(windows.sums(kernel), 1e-300)[row]
    moments = [windows.sums(kernel * offset**power) for power in range(5)]
    normal = np.stack(
        [np.stack(moments[k : k + 3], axis=1) for k in range(3)], axis=1
    ) + 1e-9 * np.eye(3)
    first = np.linalg.solve(normal, np.eye(3)[None, :, :1].repeat(len(normal), axis=0))[row, :, 0]
    shares = kernel * (first[:, 0] + first[:, 1] * offset + first[:, 2] * offset**2)
    shares /= windows.sums(shares)[row]
    matrix = csr_array((shares, windows.point, windows.first), shape=(len(normal), windows.points))
    return np.asarray(matrix @ points), matrix


def _spread(covariance: FloatArray, shares: csr_array, section: IntArray, count: int) -> FloatArray:
    """(q, 3, 3): per section its share squared times its mean covariance there."""
    total = np.zeros((shares.shape[0], 3, 3))
    columns = shares.tocsc()
    for k in range(count):
        own = columns[:, np.flatnonzero(section == k)]
        weights = abs(own)
        weight = weights.sum(axis=1)
        mean = (weights @ covariance[section == k].reshape(-1, 9)).reshape(-1, 3, 3)
        mean /= np.maximum(weight, 1e-12)[:, None, None]
        share = np.minimum(np.abs(own.sum(axis=1)), 1.0)
        total += share[:, None, None] ** 2 * mean
    return total


def _as_curve(points: FloatArray, spread: FloatArray, placed: list[Curve]) -> Curve:
    spans = max(3, min(len(points) // 2, 120))
    along = arc_lengths(points)
    if along[-1] < _SHORTEST_M:
        raise NotMergeable(
            "fold back onto themselves within `window_m`: no curve is left", "curves"
        )
    spline = curves.fit(points, spans, smooth=1e-6)
    tangents = spline.tangents(along / along[-1])
    radii = np.array([c.mean_radius_m for c in placed])
    known = radii[np.isfinite(radii)]
    radius = float(np.median(known)) if len(known) else float("nan")
    sigmas = np.array([c.radius_sigma_m for c in placed])
    stated = sigmas[np.isfinite(sigmas)]
    sigma = float(stated.mean() / np.sqrt(len(stated))) if len(stated) else float("nan")
    return Curve(spline, points, across(spread, tangents), np.full(len(points), radius), sigma)
