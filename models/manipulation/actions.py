"""Action estimation (thesis 5.5.1): the best pick-and-place for every edge at once, eq. 5.7 to
5.9."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import Minimum, SolverParams, minimize
from models.manipulation.scaling import MOVE_SCALE

ACTION_SOLVER = SolverParams()


@dataclass(frozen=True, eq=False)
class Candidates:
    """C actions, best first: ``edge`` (C,), ``move`` (C, 3), the states they lead to (C, n, 2), the
    mean distance of those to the target (C,) m, and whether the optimum was found to the
    tolerance."""

    edge: IntArray
    move: FloatArray
    predicted: FloatArray
    error: FloatArray
    converged: NDArray[np.bool_]

    def taken(self, rows: IntArray | slice) -> Candidates:
        return Candidates(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, others: Candidates) -> Candidates:
        """These, then the others."""
        names = self.__dataclass_fields__
        return Candidates(
            *(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names)
        )


def best_actions(
    dynamics: Dynamics,
    state: FloatArray,
    target: FloatArray,
    rope: FloatArray,
    edges: IntArray,
    largest: FloatArray = MOVE_SCALE,
    params: SolverParams = ACTION_SOLVER,
) -> Candidates:
    """One optimized action for each of ``edges``, from the state (n, 2) towards the target (n, 2).

    ``largest`` (3,) bounds of |dx|, |dy| and |dtheta|. Two starts an edge: no motion, and the
    motion that puts the edge where the target has it.
    """
    starts = np.concatenate([np.zeros((len(edges), 3)), onto_target(state, target, edges)])
    every = np.concatenate([edges, edges])
    states = np.broadcast_to(state, (len(every), *state.shape))
    found = optimized(dynamics, states, every, starts, target, rope, largest, params)
    pick = np.argmin(found.cost.reshape(2, -1), 0) * len(edges) + np.arange(len(edges))
    order = pick[np.argsort(found.cost[pick], kind="stable")]
    reached = found.residuals[order] + target
    return Candidates(
        every[order],
        found.x[order],
        reached,
        shape_distance(reached, target),
        found.converged[order],
    )


def optimized(
    dynamics: Dynamics,
    states: FloatArray,
    edges: IntArray,
    starts: FloatArray,
    target: FloatArray,
    rope: FloatArray,
    largest: FloatArray,
    params: SolverParams,
) -> Minimum:
    """The best move for each of ``edges`` (B,) from its own state (B, n, 2), beginning at
    ``starts`` (B, 3)."""

    def residuals(moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        reached, jacobian = dynamics.by_move(states, edges, moves, rope)
        return reached - target, jacobian

    return minimize(residuals, starts, -largest, largest, MOVE_SCALE, params)


def onto_target(state: FloatArray, target: FloatArray, edges: IntArray) -> FloatArray:
    """The moves (E, 3) that would put each edge on the target's."""
    here, there = (np.stack([s[edges], s[edges + 1]], 1) for s in (state, target))
    shift = there.mean(1) - here.mean(1)
    a, b = here[:, 1] - here[:, 0], there[:, 1] - there[:, 0]
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(1))
    return np.column_stack([shift, turn])
