"""Sections, branch-points and crossings of a solution, and its final graph (thesis 6.6.3)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.polylines import arc_lengths, resample
from models.geometry.sampling import read_nearest
from models.strands.ends import beyond, in_view, width_of
from models.strands.pixel_graph import smoothed
from models.topology.graph import Graph
from models.topology.scene import BranchPoint, Crossing, EndKind, Place, Predictions, Section
from models.topology.sites import ends_at
from models.topology.solver import End, Solution

_POINT_SPACING_PX = 4.0
_TIP_POINTS = 8
"""So many of a line's pixels show the direction of its end."""


@dataclass(frozen=True, eq=False)
class Walk:
    """Strands in order, end to end; ``passed``: every crossing on the way as ``(passage, which of
    its crossings, arc length)``."""

    xy: FloatArray
    radii: FloatArray
    knots: tuple[int, int]
    closed: bool
    passed: tuple[tuple[int, int, float], ...]


def walk_all(solution: Solution) -> list[Walk]:
    """Every strand is walked once, but the middles of crossings, which both strands there share."""
    onward: dict[End, tuple[End, int]] = {}
    for k, passage in enumerate(solution.passages):
        for one, other in passage.pairs:
            onward[one], onward[other] = (other, k), (one, k)
    tips = {end: k for k, passage in enumerate(solution.passages) for end in passage.tips}
    middles = {p.middle for p in solution.passages}
    left = {k for k in range(len(solution.web.strands)) if k not in middles}
    starts = [(k, e) for k in sorted(left) for e in (0, 1) if (k, e) not in onward]
    rings = [(k, 0) for k in sorted(left)]
    # A walk takes what it passes out of ``left``, so that no strand is walked twice.
    return [
        _walk(start, solution, onward, tips, left)
        for start in [*starts, *rings]
        if start[0] in left
    ]


def _walk(
    start: End,
    solution: Solution,
    onward: dict[End, tuple[End, int]],
    tips: dict[End, int],
    left: set[int],
) -> Walk:
    web = solution.web
    pieces: list[FloatArray] = []
    radii: list[FloatArray] = []
    passed = [(tips[start], 0, 0.0)] if start in tips else []
    length, here, closed = 0.0, start, False
    first = web.strands[start[0]].a if start[1] == 0 else web.strands[start[0]].b
    while True:
        left.discard(here[0])
        seen = web.strands[here[0]] if here[1] == 0 else web.strands[here[0]].reversed()
        pieces.append(seen.xy)
        radii.append(seen.radii)
        length += seen.length
        away = (here[0], 1 - here[1])
        if away not in onward:
            passed += [(tips[away], 0, length)] if away in tips else []
            closed = seen.a == seen.b and here == start and len(ends_at(web)[seen.a]) == 2
            return _finished(pieces, radii, (first, seen.b), closed, passed)
        there, k = onward[away]
        passage = solution.passages[k]
        if passage.middle is None:
            passed.append((k, 0, length))
        else:
            middle = web.strands[passage.middle]
            bridge = middle.seen_from(seen.b)
            for n, (share, _) in enumerate(passage.crossed):
                passed.append(
                    (k, n, length + (share if bridge is middle else 1 - share) * bridge.length)
                )
            pieces.append(bridge.xy)
            radii.append(bridge.radii)
            length += bridge.length
        if there[0] not in left:
            return _finished(pieces, radii, (first, first), there == start, passed)
        here = there


def _finished(
    pieces: list[FloatArray],
    radii: list[FloatArray],
    knots: tuple[int, int],
    closed: bool,
    passed: list[tuple[int, int, float]],
) -> Walk:
    xy = np.concatenate(pieces)
    keep = np.concatenate(([True], np.any(np.diff(xy, axis=0) != 0, axis=1)))
    return Walk(xy[keep], np.concatenate(radii)[keep], knots, closed, tuple(passed))


def sections_of(walks: list[Walk], solution: Solution, graph: Graph) -> list[Section]:
    """The walks as sections; free ends reach to the tip of the mask."""
    index = {knot: k for k, (knot, _) in enumerate(solution.branches)}
    sections = []
    for walk in walks:
        branches = (index.get(walk.knots[0], -1), index.get(walk.knots[1], -1))
        branches = (-1, -1) if walk.closed else branches
        width = width_of(walk.radii)
        whole = np.array([0, len(walk.xy)])
        line = smoothed(smoothed(walk.xy, whole), whole)
        line = _with_tips(line, branches, walk, graph)
        count = max(2, round(float(arc_lengths(line)[-1]) / _POINT_SPACING_PX) + 1)
        xy = resample(line, count)
        ends = (_kind(xy[0], branches[0], width, graph), _kind(xy[-1], branches[1], width, graph))
        covered = float((read_nearest(graph.distances, xy) > 0).mean())
        length = float(arc_lengths(xy)[-1])
        sections.append(
            Section(
                xy, width, length, ends, branches, walk.closed, covered, _end_widths(walk, width)
            )
        )
    return sections


def _end_widths(walk: Walk, width: float) -> tuple[float, float]:
    reach = max(3, min(round(3 * width), len(walk.radii) // 2))
    return 2 * float(walk.radii[:reach].max()), 2 * float(walk.radii[-reach:].max())


def _with_tips(line: FloatArray, branches: tuple[int, int], walk: Walk, graph: Graph) -> FloatArray:
    if walk.closed:
        return line
    tips = [
        beyond(way, graph.distances, float(radius), _TIP_POINTS) if branch < 0 else line[:0]
        for way, radius, branch in zip(
            (line, line[::-1]), walk.radii[[0, -1]], branches, strict=True
        )
    ]
    return np.concatenate((tips[0], line, tips[1]))


def _kind(xy: FloatArray, branch: int, width: float, graph: Graph) -> EndKind:
    if branch >= 0:
        return "branch"
    return "free" if in_view(xy, graph.distances.shape, width / 2) else "border"


def branch_points_of(solution: Solution, sections: list[Section]) -> list[BranchPoint]:
    """Each with the sections that meet there; a section that leaves it and comes back counts
    twice."""
    found = []
    for k, (knot, score) in enumerate(solution.branches):
        meeting = tuple(i for i, s in enumerate(sections) for b in s.branches if b == k)
        x, y = solution.web.knots_xy[knot].tolist()
        found.append(BranchPoint((x, y), meeting, score))
    return found


def crossings_of(walks: list[Walk], solution: Solution) -> list[Crossing]:
    """One for every two walks through a passage, or two passes of one walk, at each place where
    they cross; which is above is not yet known."""
    passes: dict[tuple[int, int], list[Place]] = {}
    for k, walk in enumerate(walks):
        whole = max(float(arc_lengths(walk.xy)[-1]), 1e-9)
        for passed, which, at in walk.passed:
            passes.setdefault((passed, which), []).append(Place(k, min(1.0, at / whole)))
    found = []
    for (k, which), places in sorted(passes.items()):
        passage = solution.passages[k]
        x, y = passage.crossed[which][1].tolist()
        found += [
            Crossing((x, y), one, other, passage.score)
            for n, one in enumerate(places)
            for other in places[n + 1 :]
        ]
    return found


def final_links(
    walks: list[Walk], graph: Graph, predictions: Predictions
) -> tuple[IntArray, FloatArray]:
    """The edges of the final graph: nodes that follow one another on a walk, with the probability
    of the link."""
    known = {
        (int(i), int(j)): float(p) for i, j, p in zip(*graph.edges, predictions.links, strict=True)
    }
    found: dict[tuple[int, int], float] = {}
    for walk in walks:
        order = _visits(walk, graph)
        order += order[:1] if walk.closed else []
        for a, b in pairwise(order):
            pair = (min(a, b), max(a, b))
            if a != b:
                found[pair] = known.get(pair, 0.5)
    pairs = np.array(sorted(found), dtype=np.int64).reshape(-1, 2)
    return pairs, np.array([found[p] for p in sorted(found)])


def _visits(walk: Walk, graph: Graph) -> list[int]:
    """The nodes that a walk passes, in order; a node at a self-crossing comes twice."""
    reach = np.maximum(2, graph.radii / 2)
    visits = []
    for node, places in enumerate(
        cKDTree(walk.xy).query_ball_point(graph.xy, reach, return_sorted=True)
    ):
        if places:
            runs = np.split(np.array(places), np.flatnonzero(np.diff(places) > 1) + 1)
            visits += [(float(run.mean()), node) for run in runs]
    return [node for _, node in sorted(visits)]
