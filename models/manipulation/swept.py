"""Whether a DLO on its way enters an area: not only where it comes to rest (keep-out areas)."""

from __future__ import annotations

import numpy as np

from models.geometry.polylines import intersections
from models.manipulation.actions import Candidates
from models.manipulation.belief import Belief
from models.manipulation.frames import FloatArray
from models.manipulation.limits import inside

_SHARES = np.array([0.25, 0.5, 0.75])
"""Of the gripper's way at which the DLO's shape is foreseen; between them its points go
straight."""


def ways(belief: Belief, state: FloatArray, found: Candidates) -> FloatArray:
    """(C, T, n, 2) the DLO before, on the way, and after each of C actions from one state."""
    count, parts = len(found.edge), len(_SHARES)
    moves = (_SHARES[:, None] * found.move[:, None]).reshape(-1, 3)
    states = np.broadcast_to(state, (len(moves), *state.shape))
    between = belief.likeliest(states, np.repeat(found.edge, parts), moves).reshape(
        count, parts, *state.shape
    )
    before = np.broadcast_to(state, (count, 1, *state.shape))
    return np.concatenate([before, between, found.predicted[:, None]], 1)


def enters(shapes: FloatArray, zone: FloatArray) -> bool:
    """Whether the surface that the polylines (T, n, 2) sweep one after the other meets a polygon
    (k, 2).

    Exact for straight ways between the shapes, however small the polygon is.
    """
    if inside(shapes.reshape(-1, 2), zone).any():
        return True
    starts = np.concatenate([shapes[:, :-1].reshape(-1, 2), shapes[:-1].reshape(-1, 2)])
    ends = np.concatenate([shapes[:, 1:].reshape(-1, 2), shapes[1:].reshape(-1, 2)])
    if len(intersections((starts, ends), (zone, np.roll(zone, -1, 0)))[0]):
        return True
    a, b, c, d = (
        p.reshape(-1, 2)
        for p in (shapes[:-1, :-1], shapes[:-1, 1:], shapes[1:, 1:], shapes[1:, :-1])
    )
    return _any_in_triangle(zone, a, b, c) or _any_in_triangle(zone, a, c, d)


def _any_in_triangle(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> bool:
    """Whether one of the points (m, 2) is in one of the triangles with corners ``a``, ``b``,
    ``c`` (t, 2)."""
    sides = np.stack([_side(points, *pair) for pair in ((a, b), (b, c), (c, a))])
    ab, ac = b - a, c - a
    whole = ab[:, 0] * ac[:, 1] != ab[:, 1] * ac[:, 0]
    within = ((sides >= 0).all(0) | (sides <= 0).all(0)) & whole
    return bool(within.any())


def _side(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(m, t) twice the signed area of each point with each line."""
    line, away = end - start, points[:, None] - start
    return np.asarray(line[:, 0] * away[..., 1] - line[:, 1] * away[..., 0])
