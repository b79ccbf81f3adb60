"""How far a DLO is from a shape where fixtures stand between: the mean way of its points around
them.

Strategy: a DLO reaches another shape only by ways that pull no part of it through a peg. The way of
one point is homotopic to the chain that runs from it along the DLO to its first point, over to the
target's first point and along the target to the point's place. A shortcut between two vertices of
the chain is allowed where it is clear of all capsules and is seen from every corner under the same
angle as the part of the chain that it replaces; then the two enclose no corner. The shortest
allowed way is that of a string pulled over points of both shapes. All angles are sums along the
chain, so one table of shortcuts serves all points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.manipulation.fixtures import Fixtures
from models.manipulation.frames import FloatArray, IntArray

_SAME_RAD = 1e-3


def detours(
    states: FloatArray, target: FloatArray, fixtures: Fixtures, every: int = 1
) -> FloatArray:
    """(B, m) m from each ``every``-th point of DLOs (B, n, 2) to its place in the target (n, 2)."""
    picked = np.arange(0, len(target), every)
    chains, at = _chains(states, target, picked)
    legs = _legs(chains, at, fixtures)
    ways, _ = _shortest(legs)
    count = len(picked)
    return ways[:, count - 1 - np.arange(count), count + np.arange(count)]


def string_ways(
    state: FloatArray, target: FloatArray, fixtures: Fixtures, points: Sequence[int]
) -> list[FloatArray]:
    """For each of some points of a DLO (n, 2) the vertices (k, 2) of the way to its place in the
    target."""
    chains, at = _chains(state[None], target, np.arange(len(target)))
    _, before = _shortest(_legs(chains, at, fixtures))
    return [chains[0, _vertices(before[0], len(target) - 1 - p, len(target) + p)] for p in points]


def _vertices(before: IntArray, first: int, last: int) -> list[int]:
    """Of the shortest way between two vertices; ``before`` (v, v) the last one but one of every
    way."""
    found = [last]
    while found[-1] != first:
        found.append(int(before[first, found[-1]]))
    return found[::-1]


def _chains(
    states: FloatArray, target: FloatArray, picked: IntArray
) -> tuple[FloatArray, IntArray]:
    """(B, 2 n, 2) back along each DLO and on along the target; the indices of picked points in it
    (2 m,)."""
    nodes = len(target)
    there = np.broadcast_to(target, states.shape)
    at = np.concatenate([nodes - 1 - picked[::-1], nodes + picked])
    return np.concatenate([states[:, ::-1], there], 1), at


def _legs(chains: FloatArray, at: IntArray, fixtures: Fixtures) -> FloatArray:
    """(B, v, v) lengths of the allowed legs between the chain's vertices ``at`` (v,), infinite
    where there is none; from earlier to later ones only."""
    vertices, many = chains[:, at], len(at)
    i, j = np.triu_indices(many, 1)
    a, b = vertices[:, i], vertices[:, j]
    length = np.hypot(*np.moveaxis(b - a, -1, 0))
    allowed = _same_side(chains, at, i, j, fixtures.corners[0]) & (j > i + 1)
    allowed[allowed] = (fixtures.gap(a[allowed], b[allowed]) >= 0).all(1)
    along = np.cumsum(np.hypot(*np.moveaxis(np.diff(chains, axis=1), -1, 0)), 1)
    along = np.concatenate([np.zeros((len(chains), 1)), along], 1)[:, at]
    # What the DLO itself does is possible, however near to a peg it is.
    length = np.where(allowed, length, np.where(j == i + 1, along[:, j] - along[:, i], np.inf))
    legs = np.full((len(chains), many, many), np.inf)
    legs[:, i, j] = length
    return legs


def _same_side(
    chains: FloatArray, at: IntArray, i: IntArray, j: IntArray, corners: FloatArray
) -> np.ndarray:
    """(B, L) whether each leg turns about every corner as the chain between its ends does."""
    seen = chains[:, :, None] - corners
    turned = np.concatenate(
        [np.zeros_like(seen[:, :1, :, 0]), np.cumsum(_angle(seen[:, :-1], seen[:, 1:]), 1)], 1
    )
    turned, seen = turned[:, at], seen[:, at]
    off = turned[:, j] - turned[:, i] - _angle(seen[:, i], seen[:, j])
    return np.asarray((np.abs(off) < _SAME_RAD).all(-1))


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """(…,) rad from directions ``a`` to ``b`` (…, 2)."""
    return np.asarray(np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(-1)))


def _shortest(legs: FloatArray) -> tuple[FloatArray, IntArray]:
    """(B, v, v) lengths of the shortest ways from each vertex to each later one, and the last
    vertex before it."""
    ways = np.where(np.eye(legs.shape[1], dtype=bool), 0.0, np.inf) + np.zeros_like(legs)
    before = np.zeros(legs.shape, np.int64)
    for k in range(1, legs.shape[1]):
        through = ways[:, :, :k] + legs[:, None, :k, k]
        last = np.argmin(through, 2)
        before[:, :, k] = last
        shorter = np.take_along_axis(through, last[..., None], 2)[..., 0]
        ways[:, :, k] = np.minimum(ways[:, :, k], shorter)
    return ways, before
