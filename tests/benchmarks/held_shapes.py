"""What a gripper that lets go can reach at best: the shape nearest to a target that friction holds.

Strategy: a rope at rest is a chain in which the friction at every node balances what the bending
moments and the tensions of its edges leave there. Its headings, its place and the tensions are
found for which the mean distance to the target is least and no node needs more than its friction.
The stiffness is raised in steps from one at which the target itself is held, so that every search
begins near its end. The search is local: a nearer shape may exist.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from tests.benchmarks.ropes import NODES, RopeKind

_GRAVITY = 9.81
_DIAGONAL = 2**0.5
"""MuJoCo's friction is a pyramid: along its diagonals it holds so much more than the
coefficient."""
_PARTS = (0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Of the stiffness, one after the other."""
_OVER = 1e-2
"""That a search may leave a node above its friction."""
_EDGES = NODES - 1


def nearest_held(
    kind: RopeKind, friction: float, stiffer: float, target: np.ndarray
) -> float | None:
    """Mean distance in m from the target (n, 2) to the nearest shape found that a rope of ``kind``,
    ``stiffer`` times as stiff, keeps on a table with this coefficient of friction; None: none
    found."""
    edge = kind.length / _EDGES
    holding = _DIAGONAL * friction * kind.mass / _EDGES * _GRAVITY
    stiffness = stiffer * kind.stiffness / edge / holding
    allowed = np.ones(NODES)
    allowed[[0, -1]] = 0.5
    steps = np.diff(target, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    found = np.concatenate([target[0], heading, np.zeros(_EDGES)])
    away: float | None = None
    for part in _PARTS:
        room = _room(part * stiffness, edge, allowed)
        best = minimize(
            lambda q: 1e3 * np.sqrt(((_nodes(q, edge) - target) ** 2).sum(1) + 1e-8).mean(),
            found,
            constraints=[{"type": "ineq", "fun": room}],
            method="SLSQP",
            options={"maxiter": 300},
        )
        found = best.x
        away = best.fun / 1e3 if room(found).min() > -_OVER else None
    return away


def _room(stiffness: float, edge: float, allowed: np.ndarray):
    """Squares of the friction (n,) of the nodes, in that of an inner one, less what they need."""

    def room(q: np.ndarray) -> np.ndarray:
        heading, tension = q[2 : 2 + _EDGES], q[2 + _EDGES :]
        moments = np.concatenate([[0.0], stiffness * np.diff(heading), [0.0]])
        along = np.column_stack([np.cos(heading), np.sin(heading)])
        across = np.column_stack([-along[:, 1], along[:, 0]])
        pull = tension[:, None] * along - (np.diff(moments) / edge)[:, None] * across
        force = np.zeros((NODES, 2))
        force[:-1] += pull
        force[1:] -= pull
        return allowed**2 - (force**2).sum(1)

    return room


def _nodes(q: np.ndarray, edge: float) -> np.ndarray:
    heading = q[2 : 2 + _EDGES]
    steps = edge * np.column_stack([np.cos(heading), np.sin(heading)])
    return np.asarray(q[:2] + np.vstack([np.zeros((1, 2)), np.cumsum(steps, 0)]))
