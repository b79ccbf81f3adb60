"""From a state and a target to ranked actions: one step, or several ahead.

Strategy for a horizon of h: every branch keeps its best few actions (a beam), each branch's next actions are
optimized from where the network says the DLO will be, and the first actions of the best sequences are ranked by where
the whole sequence ends. Then all moves of each of the best sequences are polished together, by finite differences of
the rolled-out network in one batch, so that the first action is no longer greedy. A longer look leans on predictions of
predictions: it is taken only where one action alone brings little. Nothing is random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.manipulation.actions import Candidates, best_actions
from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import SolverParams, minimize
from models.manipulation.limits import Limits, checks
from models.manipulation.scaling import MOVE_SCALE

_BEAM = 4
_BRANCHES = 4
_POLISHED = 3
_ENOUGH_SHARE, _ENOUGH_M = 0.6, 0.008
"""An action that leaves no more than this share of the distance, or this distance, needs no longer look."""
_DIFFERENCE = np.array([1e-3, 1e-3, 1e-2])


@dataclass(frozen=True, eq=False)
class Sequence:
    """Actions one after another: ``edges`` (h,), ``moves`` (h, 3), the states after each (h, n, 2), and the mean
    distance m of the last to the target."""

    edges: IntArray
    moves: FloatArray
    states: FloatArray
    error: float


def plan(
    dynamics: Dynamics, state: FloatArray, target: FloatArray, rope: FloatArray, limits: Limits, horizon: int
) -> tuple[Candidates, FloatArray]:
    """Ranked first actions, and the mean distance (C,) to the target at the end of each one's sequence.

    Where only one action is looked at, that is the distance after the action itself. Candidates that break a limit are
    left out; there may be none.
    """
    first = _kept(dynamics, state, target, rope, limits)
    enough = max(_ENOUGH_SHARE * float(shape_distance(state, target)), _ENOUGH_M)
    if horizon == 1 or not len(first.edge) or first.error[0] <= enough:
        return first, first.error
    beam = [_begun(first, k) for k in range(min(_BEAM, len(first.edge)))]
    finished = list(beam)
    for _ in range(horizon - 1):
        beam = sorted(_extended(dynamics, beam, target, rope, limits), key=lambda s: s.error)[:_BEAM]
        finished += beam
    finished.sort(key=lambda s: (s.error, len(s.edges)))
    polished = [_polished(dynamics, state, s, target, rope, limits) for s in finished[:_POLISHED]]
    return _ranked(state, first, [*polished, *finished], target, limits)


def _kept(dynamics: Dynamics, state: FloatArray, target: FloatArray, rope: FloatArray, limits: Limits) -> Candidates:
    """One action an edge, those that keep all limits, best first."""
    found = best_actions(dynamics, state, target, rope, limits.edges(len(state)), limits.largest)
    allowed = [k for k in range(len(found.edge)) if all(c.passed for c in checks(state, found, k, limits))]
    return found.taken(np.asarray(allowed, np.int64))


def _begun(first: Candidates, k: int) -> Sequence:
    return Sequence(first.edge[k : k + 1], first.move[k : k + 1], first.predicted[k : k + 1], float(first.error[k]))


def _extended(
    dynamics: Dynamics, beam: list[Sequence], target: FloatArray, rope: FloatArray, limits: Limits
) -> list[Sequence]:
    longer: list[Sequence] = []
    for begun in beam:
        following = _kept(dynamics, begun.states[-1], target, rope, limits)
        longer += [_continued(begun, following, k) for k in range(min(_BRANCHES, len(following.edge)))]
    return longer


def _continued(begun: Sequence, following: Candidates, k: int) -> Sequence:
    return Sequence(
        np.append(begun.edges, following.edge[k]),
        np.vstack([begun.moves, following.move[k]]),
        np.concatenate([begun.states, following.predicted[k : k + 1]]),
        float(following.error[k]),
    )


def roll_out(dynamics: Dynamics, state: FloatArray, edges: IntArray, moves: FloatArray, rope: FloatArray) -> FloatArray:
    """(B, h, n, 2) states after each of ``moves`` (B, h, 3) on ``edges`` (h,), from one state."""
    current = np.broadcast_to(state, (len(moves), *state.shape))
    reached = []
    for k, edge in enumerate(edges):
        current = dynamics.predict(current, np.full(len(moves), edge), moves[:, k], rope)
        reached.append(current)
    return np.stack(reached, 1)


def _polished(
    dynamics: Dynamics, state: FloatArray, found: Sequence, target: FloatArray, rope: FloatArray, limits: Limits
) -> Sequence:
    """The sequence with all its moves optimized together."""
    steps = len(found.edges)
    if steps == 1:
        return found
    difference = np.tile(_DIFFERENCE, steps)

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Central differences: two roll-outs an unknown, all in one batch."""
        shifted = np.concatenate([x, x + np.diag(difference), x - np.diag(difference)])
        last = roll_out(dynamics, state, found.edges, shifted.reshape(-1, steps, 3), rope)[:, -1]
        plus, minus = last[1 : 1 + len(difference)], last[1 + len(difference) :]
        slopes = (plus - minus) / (2 * difference)[:, None, None]
        return (last[0] - target)[None], np.moveaxis(slopes, 0, -1)[None]

    largest, scale = np.tile(limits.largest, steps), np.tile(MOVE_SCALE, steps)
    best = minimize(residuals, found.moves.reshape(1, -1), -largest, largest, scale, SolverParams(steps=8))
    moves = best.x.reshape(1, steps, 3)
    states = roll_out(dynamics, state, found.edges, moves, rope)[0]
    return Sequence(found.edges, moves[0], states, float(shape_distance(states[-1], target)))


def _ranked(
    state: FloatArray, first: Candidates, sequences: list[Sequence], target: FloatArray, limits: Limits
) -> tuple[Candidates, FloatArray]:
    """First actions by the end of their best sequence, one an edge; behind them the edges that no sequence begins
    with, by their own distance."""
    rows: dict[int, tuple[FloatArray, FloatArray, float]] = {}
    for s in sorted(sequences, key=lambda s: s.error):
        edge = int(s.edges[0])
        one = Candidates(s.edges[:1], s.moves[:1], s.states[:1], np.zeros(1), np.ones(1, bool))
        if edge not in rows and all(c.passed for c in checks(state, one, 0, limits)):
            rows[edge] = (s.moves[0], s.states[0], s.error)
    rest = [k for k in range(len(first.edge)) if int(first.edge[k]) not in rows]
    predicted = np.stack([*(r[1] for r in rows.values()), *(first.predicted[k] for k in rest)])
    ranked = Candidates(
        edge=np.array([*rows, *(int(first.edge[k]) for k in rest)]),
        move=np.stack([*(r[0] for r in rows.values()), *(first.move[k] for k in rest)]),
        predicted=predicted,
        error=shape_distance(predicted, target),
        converged=np.array([*(True for _ in rows), *(bool(first.converged[k]) for k in rest)]),
    )
    ends = [*(r[2] for r in rows.values()), *(float(first.error[k]) for k in rest)]
    return ranked, np.asarray(ends)
