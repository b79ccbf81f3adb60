"""Scores at intersections, and Algorithm 1: from the region graph to one path a DLO (thesis 3.3.6,
3.3.7)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from scipy.special import expit

from models.geometry.arrays import FloatArray
from models.instances.published.ariadne_plus.superpixels import Regions

_CONCENTRATION = 2.0
"""Of the von Mises distribution, taken relative to its peak: 1 for no change of the turn."""
_MAX_BRANCHES = 24
"""Neighbors of an intersection that are compared pairwise."""

Appearance = Callable[[list[int]], FloatArray]
"""Nodes to their squared distances ``(n, n)`` in TripletNet's embedding."""


def curvature_score(points_xy: FloatArray) -> float:
    """Von Mises score of an ordered sequence of three or four points: high where the direction
    changes evenly.

    With four points the two turns are compared (``M(phi_1 - phi_2)`` of the thesis) and each turn
    counts by itself too; with three there is one turn. ``(n, 2)`` to 0 … 1.
    """
    steps = np.diff(points_xy, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.angle(np.exp(1j * np.diff(headings)))
    angles = np.append(turns, np.diff(turns)) if len(turns) > 1 else turns
    return float(np.exp(_CONCENTRATION * (np.cos(angles) - 1)).prod())


def intersection_scores(
    regions: Regions, appearance: Appearance | None
) -> list[tuple[float, int, int, int]]:
    """``(score, n_k, n_l, intersection)`` of every pair of neighbors of every intersection: W_pred
    of 3.3.6."""
    scores = []
    for node in np.flatnonzero(regions.is_intersection).tolist():
        around = [n for n in regions.neighbors[node] if not regions.is_intersection[n]][
            :_MAX_BRANCHES
        ]
        if len(around) < 2:
            continue
        alike = np.ones((len(around), len(around)))
        if appearance is not None:
            alike = 2 * expit(-appearance(around))  # 1 at distance 0
        for i, j in combinations(range(len(around)), 2):
            curve = curvature_score(_sequence(regions, around[i], node, around[j]))
            scores.append((float(alike[i, j]) * curve, around[i], around[j], node))
    return scores


def _sequence(regions: Regions, k: int, node: int, l: int) -> FloatArray:  # noqa: E741
    """Centroids of ``n_k``'s other neighbor, ``n_k``, ``n_l`` and ``n_l``'s other neighbor; at
    least three places."""
    before, after = ([n for n in regions.neighbors[m] if n != node] for m in (k, l))
    outer = [before[:1], [k], [l], after[:1]]
    nodes = [n for part in outer for n in part]
    if len(nodes) < 3:
        nodes = [k, node, l]
    return regions.xy[nodes]


def find_paths(
    regions: Regions, scores: list[tuple[float, int, int, int]]
) -> list[tuple[list[int], bool]]:
    """Algorithm 1: (nodes in order, whether it is a ring) of every path.

    Partial paths run between endpoints and intersections; the best-scored pair of an intersection's
    neighbors is joined through it, each neighbor once at each intersection, until no score is left.
    """
    links: dict[tuple[int, int], tuple[int, int]] = {}
    for score, k, l, node in sorted(scores, reverse=True):  # noqa: E741
        if score > 0 and (k, node) not in links and (l, node) not in links:
            links[k, node], links[l, node] = (node, l), (node, k)
    return _walk_all(regions, links)


def _walk_all(
    regions: Regions, links: dict[tuple[int, int], tuple[int, int]]
) -> list[tuple[list[int], bool]]:
    """Every node that is no intersection is on exactly one path."""
    plain = np.flatnonzero(~regions.is_intersection).tolist()
    ways: dict[int, list[tuple[list[int], int]]] = {}
    for node in plain:
        ways[node] = []
        for beside in regions.neighbors[node]:
            if not regions.is_intersection[beside]:
                ways[node].append(([], beside))
            elif (node, beside) in links:
                via, onward = links[node, beside]
                ways[node].append(([via], onward))
    done: set[int] = set()
    paths = []
    for start in sorted(plain, key=lambda n: (len(ways[n]) != 1, n)):
        if start in done:
            continue
        path, ring = _walk(start, ways, done)
        paths.append((path, ring))
    return paths


def _walk(
    start: int, ways: dict[int, list[tuple[list[int], int]]], done: set[int]
) -> tuple[list[int], bool]:
    path, node, came_from = [start], start, -1
    done.add(start)
    while True:
        onward = [(via, n) for via, n in ways[node] if n not in done]
        if not onward:
            closing = (
                len(path) > 3
                and node != start
                and any(n == start and n != came_from for _, n in ways[node])
            )
            return path, closing
        via, following = onward[0]
        path += [*via, following]
        done.add(following)
        came_from, node = node, following
