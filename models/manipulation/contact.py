"""Contact of DLOs with fixtures, as rows of the least squares problem that :mod:`sliding` solves in
every step.

Strategy: a place of the DLO that is inside a capsule is pushed out along the shortest way, one in a
filled clip is drawn to its middle, with a force in proportion to the depth. Contact has no friction
of its own. Only places in contact make rows, so that fixtures that nothing touches cost little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.manipulation.fixtures import Clip, Fixtures
from models.manipulation.frames import FloatArray, IntArray

BoolArray = NDArray[np.bool_]
_HARD, _CLIPPED = 2e5, 1e5
"""Friction forces of a node for each meter of depth: in a peg or an edge, and off the middle of a
clip."""


@dataclass(frozen=True, eq=False)
class Pushes:
    """P places in contact: the DLO ``sim`` (P,), the ``edge`` (P,) and the ``share`` (P,) of it,
    the ``direction`` (P, 2) of the force, a unit vector, the ``depth`` (P,) m, and the ``hardness``
    (P,) of what it is in."""

    sim: IntArray
    edge: IntArray
    share: FloatArray
    direction: FloatArray
    depth: FloatArray
    hardness: FloatArray


def pushes(shapes: FloatArray, fixtures: Fixtures, held: BoolArray) -> Pushes:
    """Places where DLOs (B, n, 2) are inside a capsule or leave a clip; ``held`` (B, clips): which
    clips hold which."""
    found = [_edges_on_corners(shapes, fixtures), _nodes_on_segments(shapes, fixtures)]
    for clip, sims in zip(fixtures.clips, held.T, strict=True):
        found += [_in_clip(shapes, clip, side, sims) for side in (-0.5, 0.5) if sims.any()]
    return Pushes(
        *(np.concatenate([getattr(p, name) for p in found]) for name in Pushes.__dataclass_fields__)
    )


def add_rows(found: Pushes, normal: FloatArray, right: FloatArray, system: FloatArray) -> None:
    """Add the contact's forces to ``right`` (B, n + 1) and its stiffness to ``system`` (B, n + 1, n
    + 1), in place.

    ``normal`` (B, n - 1, 2): derivatives of a node behind an edge by the edge's heading.
    """
    if not len(found.sim):
        return
    numbers = np.arange(normal.shape[1])
    leverage = np.where(numbers < found.edge[:, None], 1.0, 0.0)
    leverage[np.arange(len(found.edge)), found.edge] = found.share
    turning = (normal[found.sim] * found.direction[:, None]).sum(-1) * leverage
    row = np.concatenate([found.direction, turning], 1)
    harder = found.hardness[:, None] * row
    np.add.at(right, found.sim, found.depth[:, None] * harder)
    np.add.at(system, found.sim, harder[:, :, None] * row[:, None])


def _edges_on_corners(shapes: FloatArray, fixtures: Fixtures) -> Pushes:
    """Pegs, and ends of edges, in the DLO's edges."""
    corners, radius = fixtures.corners
    sim, edge, corner = _near(shapes, corners, radius)
    start, line = shapes[sim, edge], shapes[sim, edge + 1] - shapes[sim, edge]
    to_corner = corners[corner] - start
    share = np.clip((to_corner * line).sum(-1) / np.maximum((line**2).sum(-1), 1e-18), 0, 1)
    away = share[:, None] * line - to_corner
    distance = np.hypot(away[:, 0], away[:, 1])
    met = distance < radius[corner]
    sim, edge, corner, share, away, distance = (
        v[met] for v in (sim, edge, corner, share, away, distance)
    )
    direction = away / np.maximum(distance, 1e-9)[:, None]
    return Pushes(sim, edge, share, direction, radius[corner] - distance, np.full(len(sim), _HARD))


def _near(
    shapes: FloatArray, corners: FloatArray, radius: FloatArray
) -> tuple[IntArray, IntArray, IntArray]:
    """The DLO, the edge and the corner of all edges (n - 1 a DLO) that may touch a corner: few of
    many."""
    middle, line = (shapes[:, 1:] + shapes[:, :-1]) / 2, shapes[:, 1:] - shapes[:, :-1]
    half = np.hypot(line[..., 0], line[..., 1]).max(1)[:, None, None] / 2
    x, y = (middle[..., None, k] - corners[:, k] for k in (0, 1))
    sim, edge, corner = np.nonzero(x * x + y * y < (radius + half) ** 2)
    return sim, edge, corner


def _nodes_on_segments(shapes: FloatArray, fixtures: Fixtures) -> Pushes:
    """The DLO's nodes in edges, between their ends."""
    line = fixtures.end - fixtures.start
    square = (line**2).sum(-1)
    long = np.flatnonzero(square > 0)
    if not len(long):
        nothing, numbers = np.zeros(0), np.zeros(0, np.int64)
        return Pushes(numbers, numbers, nothing, np.zeros((0, 2)), nothing, nothing)
    line, radius, square = line[long], fixtures.radius[long], square[long]
    to_node = shapes[:, :, None] - fixtures.start[long]
    share = (to_node * line).sum(-1) / square
    away = to_node - share[..., None] * line
    distance = np.hypot(away[..., 0], away[..., 1])
    sim, node, k = np.nonzero((distance < radius) & (share > 0) & (share < 1))
    found = distance[sim, node, k]
    edge = np.minimum(node, shapes.shape[1] - 2)
    direction = away[sim, node, k] / np.maximum(found, 1e-9)[:, None]
    hardness = np.full(len(sim), _HARD)
    return Pushes(sim, edge, (node - edge).astype(float), direction, radius[k] - found, hardness)


def _in_clip(shapes: FloatArray, clip: Clip, side: float, sims: BoolArray) -> Pushes:
    """The DLO where it passes one end of a clip, drawn to the middle: a play would be left and
    entered in turns."""
    middle = clip.xy + side * clip.length * clip.along
    ahead = (shapes - middle) @ clip.along
    step = np.diff(ahead, axis=1)
    share = np.clip(-ahead[:, :-1] / np.where(step == 0, 1.0, step), 0, 1)
    place = shapes[:, :-1] + share[..., None] * np.diff(shapes, axis=1)
    off = (place - middle) @ clip.across
    passing = ahead[:, :-1] * ahead[:, 1:] <= 0
    every = np.arange(len(shapes))
    edge = np.argmin(np.where(passing, np.abs(off), np.inf), 1)
    off, share = off[every, edge], share[every, edge]
    held = np.flatnonzero(sims & passing[every, edge])
    direction = -np.sign(off[held])[:, None] * clip.across
    return Pushes(
        held, edge[held], share[held], direction, np.abs(off[held]), np.full(len(held), _CLIPPED)
    )
