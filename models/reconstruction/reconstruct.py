"""Views to 3D curves: match, refine, ask every view whether it agrees, and keep what holds.

Strategy: for a strand of a reference view, match it against all other views at once, refine, and
see which views support the result. If some do not, the match may have followed a wrong view: it is
repeated against each other view alone, and the curve with the most supporting views wins (then the
smallest cost). Views that still do not support it are dropped with the reason, and the curve is
refined on the rest. For all DLOs of a scene every strand of every view is tried in turn; those with
the most supporting views come first and take their strands, so that identical cables cannot share
one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.reconstruction import curves
from models.reconstruction.association import Support, belonging, claimed, supports
from models.reconstruction.curves import Curve, Spline3D
from models.reconstruction.matching import Match, MatchParams, match, steepness
from models.reconstruction.refinement import Refined, RefineParams, across, refine
from models.reconstruction.tracking import expected_depth
from models.reconstruction.uncertainty import admitted
from models.reconstruction.views import View
from models.reconstruction.widths import radius_along

_ODD_DEPTH = 0.03
_FEWEST = 4
"""Samples of a strand that make a spline."""


class NotReconstructable(ValueError):
    """There is no curve that at least two views agree on; the message gives the reason."""


@dataclass(frozen=True)
class ReconstructParams:
    """``sample_px`` between matched samples of the reference strand; ``span_px`` of it to a span of
    the spline; ``points`` of the resulting curve. ``wide_reach_px``: the second try's reach of the
    matching, for poses that are a little off. ``shared_px``: standard deviation of what all
    centerlines have in common (light and shadow move the edges of a DLO the same way in every
    view), which no number of views averages out. ``stray``: see Refined.covariance_at. ``smooth``:
    of the depth along the DLO that the refinement starts from."""

    sample_px: float = 8.0
    samples: tuple[int, int] = (12, 60)
    span_px: float = 25.0
    spans: tuple[int, int] = (3, 36)
    points: int = 60
    wide_reach_px: float = 12.0
    strands_at_most: int = 24
    shared_px: float = 0.17
    stray: float = 0.25
    smooth: float = 1.0
    matching: MatchParams = field(default_factory=MatchParams)
    refinement: RefineParams = field(default_factory=RefineParams)


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A curve, how each view supports it, and where it came from: strand ``strand`` of view
    ``reference``.

    ``noise_px`` of the centerlines as the residuals show it; ``cost`` of the match.
    """

    curve: Curve
    supports: tuple[Support, ...]
    reference: int
    strand: int
    noise_px: float
    cost: float

    @property
    def used(self) -> list[int]:
        return [k for k, s in enumerate(self.supports) if s.verdict == "used"]

    @property
    def reprojection_px(self) -> float:
        return float(np.mean([self.supports[k].reprojection_px for k in self.used]))


def reconstruct_strand(
    views: list[View],
    reference: int,
    strand: int,
    params: ReconstructParams,
    previous: Curve | None = None,
) -> Reconstruction:
    """The DLO that is strand ``strand`` in view ``reference``. Raises NotReconstructable."""
    others = [k for k, view in enumerate(views) if k != reference and len(view.strands)]
    if not others:
        raise NotReconstructable(f"no DLO was found in any view but {views[reference].name}")
    tried = [others, *([k] for k in others if len(others) > 1)]
    best: _Attempt | None = None
    for which in tried:
        attempt = _attempt(views, reference, strand, which, params, previous)
        if attempt is not None and (best is None or attempt.rank > best.rank):
            best = attempt
        if best is not None and best.supporting == len(others) + 1:
            break
    if best is None or best.supporting < 2:
        name = views[reference].name
        raise NotReconstructable(
            f"no other view shows the DLO that was chosen in {name} where it could be the same"
        )
    return _finish(best, views, reference, strand, params)


def reconstruct_all(views: list[View], params: ReconstructParams) -> list[Reconstruction]:
    """Every DLO that at least two views agree on, longest first; of each view its longest strands
    are tried."""
    accepted: list[Reconstruction] = []
    partial: list[Reconstruction] = []
    taken: list[set[int]] = [set() for _ in views]
    for reference, strand in _longest_first(views, params.strands_at_most):
        if strand in taken[reference]:
            continue
        found = _exclusive(views, reference, strand, taken, params)
        if found is not None and len(found.used) == len(views):
            accepted.append(found)
            _take(found, views, taken)
        elif found is not None:
            partial.append(found)
    for candidate in sorted(partial, key=lambda r: (-len(r.used), r.cost)):
        if candidate.strand in taken[candidate.reference]:
            continue
        again = any(set(s.strands) & t for s, t in zip(candidate.supports, taken, strict=True))
        found = (
            _exclusive(views, candidate.reference, candidate.strand, taken, params)
            if again
            else candidate
        )
        if found is not None:
            accepted.append(found)
            _take(found, views, taken)
    return sorted(accepted, key=lambda r: -r.curve.length_m)


@dataclass(frozen=True, eq=False)
class _Attempt:
    """A refined curve, the strands that belong to it in each view, and what the views say about
    it."""

    refined: Refined
    strands: list[IntArray]
    supports: list[Support]
    cost: float

    @property
    def supporting(self) -> int:
        return sum(s.verdict == "used" for s in self.supports)

    @property
    def rank(self) -> tuple[int, float]:
        return self.supporting, -self.cost


def _attempt(
    views: list[View],
    reference: int,
    strand: int,
    others: list[int],
    params: ReconstructParams,
    previous: Curve | None,
) -> _Attempt | None:
    view, line = views[reference], views[reference].strands[strand]
    count = int(np.clip(line.length_px / params.sample_px, *params.samples))
    known = np.flatnonzero(line.known)
    if len(known) < _FEWEST:
        return None
    index = known[np.unique(np.linspace(0, len(known) - 1, count).astype(np.int64))]
    prior = expected_depth(previous, view.camera, line.xy[index]) if previous is not None else None
    for reach in (params.matching.reach_px, params.wide_reach_px):
        matching = replace(params.matching, reach_px=reach)
        matched = match(view, line, index, [views[k] for k in others], matching, prior)
        attempt = _refined(views, reference, strand, index, matched, reach, params)
        if attempt is not None and attempt.supporting > 1:
            return attempt
    return None


def _refined(
    views: list[View],
    reference: int,
    strand: int,
    index: IntArray,
    matched: Match,
    reach: float,
    params: ReconstructParams,
) -> _Attempt | None:
    """The match as a spline over its first to its last matched sample, refined on every view."""
    if matched.found.sum() < _FEWEST:
        return None
    camera, line = views[reference].camera, views[reference].strands[strand]
    kept = index[matched.found]
    along = (kept - kept[0]) / (kept[-1] - kept[0])
    spans = int(np.clip((kept[-1] - kept[0]) / params.span_px, *params.spans))
    weight = (
        steepness(line, kept, camera, [v.camera for k, v in enumerate(views) if k != reference])
        ** 4
    )
    depth = _smooth_depth(matched.depth[matched.found], along, weight, spans, params.smooth)
    points = camera.center + depth[:, None] * camera.rays(line.xy[kept])
    spline = curves.fit(points, spans, smooth=1e-3, parameters=along)
    dense = spline.at(np.linspace(0, 1, 20 * spans))
    strands = [belonging(dense, view, reach + 2) for view in views]
    strands[reference] = np.array([strand])
    gate = (2 * reach, max(params.refinement.gate_px[1], 0.75 * reach))
    refined = refine(spline, views, strands, replace(params.refinement, gate_px=gate))
    return _Attempt(refined, strands, supports(refined, views, strands), matched.cost)


def _smooth_depth(
    depth: FloatArray, along: FloatArray, weight: FloatArray, spans: int, smooth: float
) -> FloatArray:
    """(n,) depths on a spline of the inverse depth along the strand; where the matches say little
    (small ``weight``) it bridges from where they say more, and it passes over single ones that are
    off by more than a few percent."""
    inverse = 1 / depth
    middle = float(np.median(inverse))
    matrix = curves.basis(curves.clamped_knots(spans), along)
    rough = np.diff(np.eye(matrix.shape[1]), n=2, axis=0)
    bending = smooth * len(depth) / spans * rough.T @ rough + 1e-6 * len(depth) * np.eye(
        matrix.shape[1]
    )
    trust = weight
    for _ in range(4):
        normal = matrix.T @ (matrix * trust[:, None]) + bending
        fitted = matrix @ np.linalg.solve(normal, matrix.T @ (trust * (inverse - middle))) + middle
        trust = weight / (1 + ((inverse / fitted - 1) / _ODD_DEPTH) ** 2)
    return 1 / np.maximum(fitted, 0.1 * middle)


def _finish(
    attempt: _Attempt, views: list[View], reference: int, strand: int, params: ReconstructParams
) -> Reconstruction:
    """Refined once more on the supporting views alone, and cut to what at least two of them see."""
    refined, strands = attempt.refined, attempt.strands
    keep = [s.verdict == "used" for s in attempt.supports]
    if not all(keep):
        strands = [s if k else np.zeros(0, np.int64) for s, k in zip(strands, keep, strict=True)]
        refined = refine(refined.spline, views, strands, params.refinement)
    begin, end = _seen_range(refined)
    parameters = curves.at_equal_lengths(refined.spline, params.points, begin, end)
    curve = _curve(refined, parameters, views, strands, params)
    renewed = [
        new if kept else old
        for new, old, kept in zip(
            supports(refined, views, strands), attempt.supports, keep, strict=True
        )
    ]
    return Reconstruction(curve, tuple(renewed), reference, strand, refined.noise_px, attempt.cost)


def _seen_range(refined: Refined) -> tuple[float, float]:
    twice = np.flatnonzero(refined.used.sum(axis=0) >= 2)
    if len(twice) < 2:
        raise NotReconstructable("no part of the DLO is seen in two views")
    return float(refined.parameters[twice[0]]), float(refined.parameters[twice[-1]])


def _curve(
    refined: Refined,
    parameters: FloatArray,
    views: list[View],
    strands: list[IntArray],
    params: ReconstructParams,
) -> Curve:
    points, tangents = refined.spline.at(parameters), refined.spline.tangents(parameters)
    cameras = [view.camera for view, which in zip(views, strands, strict=True) if len(which)]
    a_pixel = np.mean([c.in_camera(points)[:, 2] / c.focal_px for c in cameras], axis=0)
    shared = (params.shared_px * a_pixel)[:, None, None] ** 2 * np.eye(3)
    covariance = refined.covariance_at(parameters, params.stray) + across(shared, tangents)
    covariance = admitted(covariance, points, cameras)
    dense = refined.spline.at(
        np.linspace(parameters[0], parameters[-1], 12 * len(refined.spline.control_m))
    )
    spline: Spline3D = curves.fit(dense, len(refined.spline.control_m) - 3, smooth=0.0)
    radius, sigma = radius_along(points, views, strands)
    return Curve(spline, points, covariance, radius, sigma)


def _exclusive(
    views: list[View], reference: int, strand: int, taken: list[set[int]], params: ReconstructParams
) -> Reconstruction | None:
    """As reconstruct_strand, but the strands that are taken do not exist; strand numbers are those
    of ``views``."""
    left = [
        [k for k in range(len(v.strands)) if k not in t] for v, t in zip(views, taken, strict=True)
    ]
    reduced = [
        replace(v, strands=tuple(v.strands[k] for k in free))
        for v, free in zip(views, left, strict=True)
    ]
    try:
        found = reconstruct_strand(reduced, reference, left[reference].index(strand), params)
    except NotReconstructable:
        return None
    renamed = tuple(
        replace(s, strands=tuple(free[k] for k in s.strands))
        for s, free in zip(found.supports, left, strict=True)
    )
    return replace(found, supports=renamed, strand=strand)


def _take(found: Reconstruction, views: list[View], taken: list[set[int]]) -> None:
    dense = found.curve.spline.at(np.linspace(0, 1, 600))
    for k in found.used:
        shares = claimed(dense, views[k])
        taken[k] |= {s for s in found.supports[k].strands if shares.get(s, 0.0) > 0.5}
    taken[found.reference].add(found.strand)


def _longest_first(views: list[View], at_most: int) -> list[tuple[int, int]]:
    """(view, strand) of the longest strands of each view. The same DLO may be whole in one view and
    in parts in another one, where it was open how it goes on."""
    every = [
        (-strand.length_px, k, number)
        for k, view in enumerate(views)
        for number, strand in sorted(enumerate(view.strands), key=lambda s: -s[1].length_px)[
            :at_most
        ]
    ]
    return [(k, number) for _, k, number in sorted(every)]
