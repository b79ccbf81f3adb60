"""From a state and a target to ranked actions: one step, or several ahead.

Strategy: for every edge the move that the network's derivatives lead to, and the move that simply
puts the edge on its place in the target, both rated by all models that may be right
(:mod:`belief`); where dry friction is more probable, the moves of the best edges are then polished
with it. For a horizon of h: every branch keeps its best few actions (a beam), each branch's next
actions are optimized from where the DLO is expected to be, and the first actions of the best
sequences are ranked by where the whole sequence ends. Then all moves of the best sequence are
polished together, so that its first action is no longer greedy. A longer look leans on predictions
of predictions: it is taken only where one action alone brings little. Nothing is random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.manipulation.actions import Candidates, best_actions, onto_target, optimized
from models.manipulation.belief import Belief
from models.manipulation.dynamics import shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.least_squares import SolverParams
from models.manipulation.limits import Limits, checks
from models.manipulation.rolled_out import polished, roll_out
from models.manipulation.swept import enters, ways

USUAL_HORIZON = 2
"""Actions that are looked ahead where nobody gives a number."""
_BEAM = 4
_BRANCHES = 4
_REFINED = 6
"""Edges of which the moves are polished where dry friction is the most probable model."""
_ENOUGH_SHARE, _ENOUGH_M = 0.6, 0.008
"""An action that leaves no more than this share of the distance, or this distance, needs no longer
look."""
_FIRST, _LATER, _TOGETHER = SolverParams(steps=6), SolverParams(steps=5), SolverParams(steps=3)
"""For the first action, for those after it, and for all of a sequence together."""
_DRY, _DRY_LATER = SolverParams(steps=3), SolverParams(steps=2)
"""The first two with dry friction, which is slower and begins from good moves."""


@dataclass(frozen=True, eq=False)
class Sequence:
    """Actions one after another: ``edges`` (h,), ``moves`` (h, 3), the states after each (h, n, 2),
    the mean distance m of the last to the target, and whether the optimizer of the first move came
    to rest."""

    edges: IntArray
    moves: FloatArray
    states: FloatArray
    error: float
    converged: bool


def plan(
    belief: Belief,
    state: FloatArray,
    target: FloatArray,
    limits: Limits,
    horizon: int = USUAL_HORIZON,
) -> tuple[Candidates, FloatArray]:
    """Ranked first actions, and the mean distance (C,) to the target at the end of each one's
    sequence.

    Where only one action is looked at, that is the distance after the action itself. Candidates
    that break a limit are left out; there may be none.
    """
    first = _kept(belief, state, target, limits)
    enough = max(_ENOUGH_SHARE * float(shape_distance(state, target)), _ENOUGH_M)
    if horizon == 1 or not len(first.edge) or first.error[0] <= enough:
        return first, first.error
    beam = [_begun(first, k) for k in range(min(_BEAM, len(first.edge)))]
    finished = list(beam)
    for _ in range(horizon - 1):
        beam = sorted(_extended(belief, beam, target, limits), key=lambda s: s.error)[:_BEAM]
        finished += beam
    finished.sort(key=lambda s: (s.error, len(s.edges)))
    best = _polished(belief, state, finished[0], target, limits)
    return _ranked(belief, state, first, [best, *finished], target, limits)


def _kept(belief: Belief, state: FloatArray, target: FloatArray, limits: Limits) -> Candidates:
    """One action an edge, those that keep all limits, best first."""
    largest = limits.largest
    found = best_actions(
        belief.dynamics, state, target, belief.rope, limits.edges(len(state)), largest, _FIRST
    )
    ruled = np.clip(onto_target(state, target, found.edge), -largest, largest)
    optimal = _rated(belief, state, target, found.edge, found.move, found.converged)
    chosen = _better(
        optimal, _rated(belief, state, target, found.edge, ruled, np.zeros(len(ruled), bool))
    )
    if belief.best:
        few = chosen.taken(np.argsort(chosen.error, kind="stable")[:_REFINED])
        starts = np.broadcast_to(state, (len(few.edge), *state.shape))
        moves, at_rest = polished(
            belief, starts, few.edge[:, None], few.move[:, None], target, largest, _DRY
        )
        again = _better(few, _rated(belief, state, target, few.edge, moves[:, 0], at_rest))
        rest = chosen.taken(np.flatnonzero(~np.isin(chosen.edge, few.edge)))
        chosen = again.joined(rest)
    chosen = chosen.taken(np.argsort(chosen.error, kind="stable"))
    return _clear(
        belief,
        state,
        chosen.taken(_allowed(np.broadcast_to(state, chosen.predicted.shape), chosen, limits)),
        limits,
    )


def _rated(
    belief: Belief,
    state: FloatArray,
    target: FloatArray,
    edges: IntArray,
    moves: FloatArray,
    converged: NDArray[np.bool_],
) -> Candidates:
    """Actions with the state that the most probable model foresees, and the distance that all
    foresee on average."""
    reached = belief.predict(np.broadcast_to(state, (len(edges), *state.shape)), edges, moves)
    error = belief.weights @ shape_distance(reached, target)
    return Candidates(edges, moves, reached[belief.best], error, converged)


def _better(some: Candidates, others: Candidates) -> Candidates:
    """Of two actions for each edge the one that ends nearer to the target."""
    count = len(some.edge)
    return some.joined(others).taken(np.arange(count) + count * (others.error < some.error))


def _allowed(states: FloatArray, found: Candidates, limits: Limits) -> IntArray:
    """Rows of the actions that keep all limits, each from its own state (C, n, 2)."""
    kept = [
        all(c.passed for c in checks(states[k], found, k, limits)) for k in range(len(found.edge))
    ]
    return np.flatnonzero(kept)


def _clear(belief: Belief, state: FloatArray, found: Candidates, limits: Limits) -> Candidates:
    """Those actions from one state on whose whole way the DLO enters no keep-out area."""
    if not limits.zones or not len(found.edge):
        return found
    entering = [
        any(enters(way, zone) for zone in limits.zones) for way in ways(belief, state, found)
    ]
    return found.taken(np.flatnonzero(~np.array(entering)))


def _begun(first: Candidates, k: int) -> Sequence:
    row = slice(k, k + 1)
    at_rest = bool(first.converged[k])
    return Sequence(
        first.edge[row], first.move[row], first.predicted[row], float(first.error[k]), at_rest
    )


def _extended(
    belief: Belief, beam: list[Sequence], target: FloatArray, limits: Limits
) -> list[Sequence]:
    """Every sequence of the beam with its best few next actions, all optimized in one batch."""
    last = np.stack([s.states[-1] for s in beam])
    edges = limits.edges(len(target))
    owner, every = np.repeat(np.arange(len(beam)), len(edges)), np.tile(edges, len(beam))
    moves = np.concatenate([onto_target(state, target, edges) for state in last])
    moves = np.clip(moves, -limits.largest, limits.largest)
    if not belief.best:
        moves = optimized(
            belief.dynamics, last[owner], every, moves, target, belief.rope, limits.largest, _LATER
        ).x
    found = _foreseen(belief, last[owner], target, every, moves)
    if belief.best:
        few = _best_rows(owner, found.error)
        owner, every = owner[few], every[few]
        sharper, _ = polished(
            belief,
            last[owner],
            every[:, None],
            moves[few, None],
            target,
            limits.largest,
            _DRY_LATER,
        )
        found = _better(
            found.taken(few), _foreseen(belief, last[owner], target, every, sharper[:, 0])
        )
    kept = _allowed(last[owner], found, limits)
    owner, found = owner[kept], found.taken(kept)
    return [_continued(beam[owner[k]], found, k) for k in _best_rows(owner, found.error).tolist()]


def _foreseen(
    belief: Belief, states: FloatArray, target: FloatArray, edges: IntArray, moves: FloatArray
) -> Candidates:
    """Actions, each from its own state (C, n, 2), by the most probable model alone."""
    reached = belief.likeliest(states, edges, moves)
    return Candidates(
        edges, moves, reached, shape_distance(reached, target), np.ones(len(edges), bool)
    )


def _best_rows(owner: IntArray, error: FloatArray) -> IntArray:
    """Rows of the few least errors of each owner."""
    order = np.lexsort((error, owner))
    first = np.searchsorted(owner[order], owner[order])
    return order[np.arange(len(order)) - first < _BRANCHES]


def _continued(begun: Sequence, following: Candidates, k: int) -> Sequence:
    return Sequence(
        np.append(begun.edges, following.edge[k]),
        np.vstack([begun.moves, following.move[k]]),
        np.concatenate([begun.states, following.predicted[k : k + 1]]),
        float(following.error[k]),
        begun.converged,
    )


def _polished(
    belief: Belief, state: FloatArray, found: Sequence, target: FloatArray, limits: Limits
) -> Sequence:
    """The sequence with all its moves optimized together."""
    if len(found.edges) == 1:
        return found
    one = state[None], found.edges[None]
    moves, at_rest = polished(belief, *one, found.moves[None], target, limits.largest, _TOGETHER)
    states = roll_out(belief, *one, moves)[0]
    return Sequence(
        found.edges, moves[0], states, float(shape_distance(states[-1], target)), bool(at_rest[0])
    )


def _ranked(
    belief: Belief,
    state: FloatArray,
    first: Candidates,
    sequences: list[Sequence],
    target: FloatArray,
    limits: Limits,
) -> tuple[Candidates, FloatArray]:
    """First actions by the end of their best sequence, one an edge; behind them the edges that no
    sequence begins with, by their own distance."""
    rows: dict[int, Sequence] = {}
    for s in sorted(sequences, key=lambda s: s.error):
        edge = int(s.edges[0])
        one = Candidates(s.edges[:1], s.moves[:1], s.states[:1], np.zeros(1), np.ones(1, bool))
        if edge not in rows and len(
            _clear(belief, state, one.taken(_allowed(state[None], one, limits)), limits).edge
        ):
            rows[edge] = s
    rest = [k for k in range(len(first.edge)) if int(first.edge[k]) not in rows]
    predicted = np.stack(
        [*(s.states[0] for s in rows.values()), *(first.predicted[k] for k in rest)]
    )
    ranked = Candidates(
        edge=np.array([*rows, *(int(first.edge[k]) for k in rest)]),
        move=np.stack([*(s.moves[0] for s in rows.values()), *(first.move[k] for k in rest)]),
        predicted=predicted,
        error=shape_distance(predicted, target),
        converged=np.array(
            [*(s.converged for s in rows.values()), *(bool(first.converged[k]) for k in rest)]
        ),
    )
    ends = [*(s.error for s in rows.values()), *(float(first.error[k]) for k in rest)]
    return ranked, np.asarray(ends)
