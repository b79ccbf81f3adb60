"""Which point of the other pictures is which point of this one: dynamic programming along the DLO.

Strategy: a sample of the reference strand is, in every other view, somewhere on its epipolar
line. Where the line crosses a strand of that view, and where a strand runs along it (tangency: no
crossing, or a whole stretch of equally good ones), is a candidate depth. A candidate costs what the
*other* views say about it: how far from any strand its point falls there, and whether the widths
agree. From sample to sample a change of depth costs as much as the DLO would have to tilt. The
cheapest path through the candidates is the match; samples whose candidates are all bad get none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.cameras import NEAREST_M, Camera, epipolar_lines
from models.geometry.directions import unit
from models.reconstruction.triangulation import depth_on_ray
from models.reconstruction.views import Strand, View


@dataclass(frozen=True)
class MatchParams:
    """Distances in pixels, costs in units of a point that is nowhere near a strand.

    ``reach_px``: farther from every strand than this is all the same (the DLO is hidden or was not
    found there). ``tangent_px``: a strand this near to an epipolar line runs along it;
    ``tangent_step_px`` between candidates then. ``tilt``: cost of a step at 45° to the picture; it
    grows with the square up to ``tilt_at_most``. ``switch``: of going over to another strand of the
    same view. ``nothing``: of a sample without a match. ``width``: of widths that differ by a
    factor of 1.65; the square of the logarithm, up to 1. ``steepest``: see without_leaps.
    """

    reach_px: float = 4.0
    tangent_px: float = 1.5
    tangent_step_px: float = 4.0
    candidates: int = 40
    tilt: float = 0.05
    tilt_at_most: float = 2.0
    switch: float = 0.5
    nothing: float = 0.8
    unseen: float = 0.3
    width: float = 1.0
    prior: float = 1.0
    steepest: float = 6.0


@dataclass(frozen=True, eq=False)
class Match:
    """``depth`` (n,) of each sample along its ray, NaN where nothing matches; ``cost`` the mean a
    matched sample."""

    depth: FloatArray
    cost: float

    @property
    def found(self) -> BoolArray:
        return np.isfinite(self.depth)


class _Candidates(NamedTuple):
    """A row per candidate: the sample it is for, depth along the ray, the view (index) and strand
    it comes from."""

    sample: IntArray
    depth: FloatArray
    view: IntArray
    strand: IntArray


def match(
    reference: View,
    strand: Strand,
    index: IntArray,
    others: list[View],
    params: MatchParams,
    prior_depth: FloatArray | None = None,
) -> Match:
    """Depths of the samples ``index`` (n,) of ``strand`` in ``reference``.

    ``prior_depth`` (n,): where an earlier reconstruction expects them, NaN where it expects
    nothing.
    """
    xy = strand.xy[index]
    rays = reference.camera.rays(xy)
    parts = [
        _candidates(reference.camera, xy, rays, k, view, params) for k, view in enumerate(others)
    ]
    found = _Candidates(*map(np.concatenate, zip(*parts, strict=True)))
    if not len(found.sample):
        return Match(np.full(len(index), np.nan), float("inf"))
    cost = _evidence(reference.camera, rays, strand.width_px[index], found, others, params)
    if prior_depth is not None:
        off = np.log(found.depth / prior_depth[found.sample]) / 0.05
        cost = cost + params.prior * np.nan_to_num(np.minimum(off**2, 1.0))
    angle = np.hypot(*np.diff(xy, axis=0).T) / reference.camera.focal_px
    matched = _cheapest(found, cost, angle, len(index), params)
    return replace(matched, depth=without_leaps(matched.depth, angle, params.steepest))


def without_leaps(depth: FloatArray, steps: FloatArray, steepest: float) -> FloatArray:
    """The longest stretch of ``depth`` (n,) that no leap interrupts, NaN elsewhere.

    ``steps`` (n - 1,) angle between neighboring samples. A leap: from one matched sample to the
    next the depth changes by more than ``steepest`` times their distance across the ray. Past it
    another DLO was followed, most often where the own one was found in no other view.
    """
    at = np.flatnonzero(np.isfinite(depth))
    if len(at) < 2:
        return depth
    along = np.concatenate(([0.0], np.cumsum(steps)))[at]
    middle = 0.5 * (depth[at][1:] + depth[at][:-1])
    leap = np.abs(np.diff(depth[at])) > steepest * middle * np.diff(along)
    stretch = np.concatenate(([0], np.cumsum(leap)))
    kept = at[stretch == np.argmax(np.bincount(stretch))]
    out = np.full(len(depth), np.nan)
    out[kept] = depth[kept]
    return out


def steepness(line: Strand, index: IntArray, camera: Camera, others: list[Camera]) -> FloatArray:
    """(n,) sine of the angle between the strand and the epipolar line of the view in which it is
    largest: how well a match shows the depth."""
    best = np.zeros(len(index))
    for other in others:
        pole = camera.intrinsics.matrix @ (camera.rotation.T @ (other.center - camera.center))
        direction = unit(pole[:2] - pole[2] * line.xy[index])
        best = np.maximum(best, np.abs(np.einsum("ni,ni->n", direction, line.normals[index])))
    return best


def _candidates(
    camera: Camera, xy: FloatArray, rays: FloatArray, number: int, view: View, params: MatchParams
) -> _Candidates:
    """Crossings of the samples' epipolar lines with the strands of one other view, and stretches
    along them."""
    samples = view.samples
    lines = epipolar_lines(camera, view.camera, xy)
    off = lines[:, :2] @ samples.xy.T + lines[:, 2:]
    joined = samples.strand[1:] == samples.strand[:-1]
    left, right = off[:, :-1], off[:, 1:]
    row, column = np.nonzero((left * right <= 0) & (left != right) & joined)
    share = left[row, column] / (left[row, column] - right[row, column])
    crossing = samples.xy[column] + share[:, None] * (samples.xy[column + 1] - samples.xy[column])
    near_row, near_column = _along(off, params)
    onto = samples.xy[near_column] - off[near_row, near_column, None] * lines[near_row, :2]
    sample = np.concatenate([row, near_row])
    place = np.concatenate([crossing, onto])
    strand = samples.strand[np.concatenate([column, near_column])]
    directions = view.camera.rays(place)
    depth = depth_on_ray(camera.center, rays[sample], view.camera.center, directions)
    points = camera.center + np.where(np.isfinite(depth), depth, 0.0)[:, None] * rays[sample]
    fine = (
        np.isfinite(depth) & (depth > NEAREST_M) & (view.camera.in_camera(points)[:, 2] > NEAREST_M)
    )
    return _Candidates(sample[fine], depth[fine], np.full(int(fine.sum()), number), strand[fine])


def _along(off: FloatArray, params: MatchParams) -> tuple[IntArray, IntArray]:
    """Where strands run along a line: every few samples of a stretch within ``tangent_px``, and the
    nearest point of a strand that only comes near."""
    near = np.abs(off) < params.tangent_px
    every = np.arange(off.shape[1]) % max(int(params.tangent_step_px), 1) == 0
    padded = np.pad(np.abs(off), ((0, 0), (1, 1)), constant_values=np.inf)
    lowest = (padded[:, 1:-1] <= padded[:, :-2]) & (padded[:, 1:-1] <= padded[:, 2:])
    row, column = np.nonzero(near & (every[None] | lowest))
    return row, column


def _evidence(
    camera: Camera,
    rays: FloatArray,
    width_px: FloatArray,
    found: _Candidates,
    others: list[View],
    params: MatchParams,
) -> FloatArray:
    """(c,) mean over the other views of the squared distance to the nearest strand, in reaches, at
    most 1, and of the disagreement of the widths."""
    points = camera.center + found.depth[:, None] * rays[found.sample]
    metric = width_px[found.sample] * found.depth
    total = np.zeros(len(points))
    for view in others:
        depth = view.camera.in_camera(points)[:, 2]
        xy = np.nan_to_num(view.camera.project(points), nan=-1e6)
        distance, nearest = view.samples.tree.query(xy, distance_upper_bound=params.reach_px)
        hit = np.isfinite(distance)
        cost = np.where(view.camera.sees(xy), 1.0, params.unseen)
        ratio = metric[hit] / (view.samples.width_px[nearest[hit]] * depth[hit])
        ratio *= camera.focal_px**-1 * view.camera.focal_px
        unlike = np.minimum((np.log(ratio) / 0.5) ** 2, 1.0)
        cost[hit] = (distance[hit] / params.reach_px) ** 2 + params.width * unlike
        total += cost
    return total / len(others)


def _cheapest(
    found: _Candidates, cost: FloatArray, steps: FloatArray, count: int, params: MatchParams
) -> Match:
    """Viterbi over at most ``candidates`` a sample, and one state without a match (the last
    column).

    ``steps`` (count - 1,) angle between neighboring samples.
    """
    table = _table(found.sample, cost, count, params.candidates)
    some = table >= 0
    depth = np.where(some, found.depth[table], 1.0)
    view, strand = np.where(some, found.view[table], -1), np.where(some, found.strand[table], -1)
    unary = np.where(some, cost[table], np.inf)
    unary = np.concatenate([unary, np.full((count, 1), params.nothing)], axis=1)
    best, came = unary[0], []
    for j in range(1, count):
        middle = 0.5 * (depth[j - 1, :, None] + depth[j, None])
        tilt = (depth[j, None] - depth[j - 1, :, None]) / (middle * max(float(steps[j - 1]), 1e-9))
        step = np.full((unary.shape[1], unary.shape[1]), params.switch)
        step[:-1, :-1] = params.tilt * np.minimum(tilt**2, params.tilt_at_most / params.tilt)
        changed = (view[j - 1, :, None] == view[j, None]) & (
            strand[j - 1, :, None] != strand[j, None]
        )
        step[:-1, :-1] += params.switch * changed
        step[-1, -1] = 0.0
        through = best[:, None] + step
        came.append(np.argmin(through, axis=0))
        best = through[came[-1], np.arange(len(best))] + unary[j]
    state = np.empty(count, np.int64)
    state[-1] = int(np.argmin(best))
    for j in range(count - 1, 0, -1):
        state[j - 1] = came[j - 1][state[j]]
    matched = state < depth.shape[1]
    chosen = np.minimum(state, depth.shape[1] - 1)
    rows = np.arange(count)
    mean = float(unary[rows, chosen][matched].mean()) if matched.any() else float("inf")
    return Match(np.where(matched, depth[rows, chosen], np.nan), mean)


def _table(sample: IntArray, cost: FloatArray, count: int, at_most: int) -> IntArray:
    """(count, C) numbers of each sample's cheapest candidates, -1 for none."""
    order = np.lexsort((cost, sample))
    sorted_sample = sample[order]
    start = np.searchsorted(sorted_sample, np.arange(count))
    place = np.arange(len(order)) - start[sorted_sample]
    kept = place < at_most
    width = int(place[kept].max(initial=0)) + 1
    table = np.full((count, width), -1)
    table[sorted_sample[kept], place[kept]] = order[kept]
    return table
