"""Several actions one after the other by the model that is believed in, and their moves optimized
together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.manipulation.belief import Belief
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import SolverParams, minimize
from models.manipulation.scaling import MOVE_SCALE

_DIFFERENCE = np.array([2e-3, 2e-3, 2e-2])


def roll_out(belief: Belief, states: FloatArray, edges: IntArray, moves: FloatArray) -> FloatArray:
    """(B, h, n, 2) states after each of ``moves`` (B, h, 3) on ``edges`` (B, h), from ``states``
    (B, n, 2)."""
    current, reached = states, []
    for k in range(edges.shape[1]):
        current = belief.likeliest(current, edges[:, k], moves[:, k])
        reached.append(current)
    return np.stack(reached, 1)


def polished(
    belief: Belief,
    states: FloatArray,
    edges: IntArray,
    moves: FloatArray,
    target: FloatArray,
    largest: FloatArray,
    params: SolverParams,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """``moves`` (B, h, 3), those of each row optimized together for where its last action ends, and
    whether the optimizer came to rest (B,); ``largest`` (3,).

    Forward differences: one roll-out an unknown, all rows in one batch.
    """
    rows, steps = edges.shape
    difference = np.tile(_DIFFERENCE, steps)
    shifts = np.concatenate([np.zeros((1, 3 * steps)), np.diag(difference)])
    every = (len(shifts), 1)

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        tried = (x + shifts[:, None]).reshape(-1, steps, 3)
        reached = roll_out(belief, np.tile(states, (*every, 1)), np.tile(edges, every), tried)
        last = reached[:, -1].reshape(len(shifts), rows, *target.shape)
        slopes = (last[1:] - last[0]) / difference[:, None, None, None]
        return last[0] - target, np.moveaxis(slopes, 0, -1)

    bounds, scale = np.tile(largest, steps), np.tile(MOVE_SCALE, steps)
    best = minimize(residuals, moves.reshape(rows, -1), -bounds, bounds, scale, params)
    return best.x.reshape(rows, steps, 3), best.converged
