"""What is known of one DLO and its table: a few models that may be right, weighed by what actions
did so far.

Strategy: the network (viscous friction) with the parameters estimated online is one model; dry
friction (:mod:`sliding`) at a few stiffnesses is the others. Each explains the history more or less
well; the likelihoods are the weights. An action is rated by what it brings on average over the
models, and their disagreement, with what none of them explained so far, is how sure that is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.manipulation.dynamics import NODES, Dynamics, shape_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.parameters import Estimate, History, fitted, length_at_rest, polished
from models.manipulation.sliding import STIFFNESS_M, Sliders, left_alone, slide

_GRID = np.geomspace(*STIFFNESS_M, 12)
"""Stiffnesses s in m that are tried for dry friction."""
_USUAL_M, _SPREAD = 0.25, 1.3
"""Stiffness before anything is seen: its median, and the spread of its logarithm."""
_VISCOUS = 0.5
"""Share of tables that behave as the network has learned, before anything is seen."""
_KEPT = 2
"""Stiffnesses that are looked at; each costs as much as the network."""
LEARNED_FROM, _LATEST = 8, 6
"""Items of the history that count, for k_b and k_d, and for what model it is: friction changes with
the place and with wear."""
NOISE_M, _NOISE_SHARE = 1.5e-3, (0.05, 0.15)
"""What even the right model leaves: of cameras, and of the motion, where the best model decides
between the bounds."""
_USUAL_RESIDUAL, _USUAL_COUNT = 0.2, 2.0
"""Share of a motion that no model explains, before anything is seen, and how many items that is
worth."""


@dataclass(frozen=True, eq=False)
class Belief:
    """The network with ``rope`` (3,), of probability ``weights[0]``, and dry friction at
    ``stiffness`` (K,) m.

    ``explained_m`` (M, n, 2): where the most probable model has the DLO after each item of
    ``history``; ``foretold_m``: where the model had it that was the most probable one before that
    item.
    """

    dynamics: Dynamics
    rope: FloatArray
    stiffness: FloatArray
    weights: FloatArray
    history: History
    explained_m: FloatArray
    foretold_m: FloatArray

    @staticmethod
    def certain(dynamics: Dynamics, rope: FloatArray) -> Belief:
        """In the network alone."""
        none = np.zeros((0, NODES, 2))
        history = History(none, np.zeros(0, np.int64), np.zeros((0, 3)), none)
        return Belief(dynamics, rope, np.zeros(0), np.ones(1), history, none, none)

    @property
    def best(self) -> int:
        """Index of the most probable model; 0 is the network."""
        return int(np.argmax(self.weights))

    @property
    def residual_m(self) -> FloatArray:
        """(M,) mean distance that the most probable model leaves of each item of the history."""
        return shape_distance(self.explained_m, self.history.after)

    def predict(self, states: FloatArray, edges: IntArray, moves: FloatArray) -> FloatArray:
        """(1 + K, B, n, 2) states after each action, a model each."""
        network = self.dynamics.predict(states, edges, moves, self.rope)[None]
        return np.concatenate([network, _slid(self.stiffness, states, edges, moves)])

    def likeliest(self, states: FloatArray, edges: IntArray, moves: FloatArray) -> FloatArray:
        """(B, n, 2) states after each action by the most probable model alone."""
        if self.best == 0:
            return self.dynamics.predict(states, edges, moves, self.rope)
        return np.asarray(_slid(self.stiffness[self.best - 1 : self.best], states, edges, moves)[0])

    def springs_back_m(self, shape: FloatArray) -> float:
        """Mean distance that a DLO put down in a shape moves by itself, for the most probable
        stiffness; 0 while viscous friction, under which nothing stays bent, is more probable than
        dry friction."""
        if self.best == 0:
            return 0.0
        ropes = Sliders.straight(self.stiffness[self.best - 1 : self.best], len(shape))
        return float(shape_distance(left_alone(shape[None], ropes)[0], shape))

    @property
    def unexplained(self) -> float:
        """Share of a motion that the models leave."""
        return self._off(self.explained_m)

    @property
    def surprising(self) -> float:
        """Share of a motion by which it is not what was foretold."""
        return self._off(self.foretold_m)

    def _off(self, shapes: FloatArray) -> float:
        moved = shape_distance(self.history.before, self.history.after)
        share = np.minimum(
            shape_distance(shapes, self.history.after) / np.maximum(moved, NOISE_M), 1.0
        )
        total = (share**2).sum() + _USUAL_COUNT * _USUAL_RESIDUAL**2
        return float(np.sqrt(total / (len(moved) + _USUAL_COUNT)))


def learned(
    dynamics: Dynamics, history: History, mass: float, length: float | None = None
) -> tuple[Belief, Estimate]:
    """What the latest actions show of a DLO of ``mass`` kg, and k_b and k_d with them; ``length`` m as for
    :func:`estimate`. The analytical model, which takes longest, is asked only where it is the most probable."""
    recent = history.latest(LEARNED_FROM)
    if length is None and len(history.edge):
        length = length_at_rest(history)
    found = fitted(dynamics, recent, mass)
    belief = believed(dynamics, found.rope(mass), recent)
    if belief.best:
        return belief, found
    found = polished(found, recent, mass, length)
    return (believed(dynamics, found.rope(mass), recent) if len(recent.edge) else belief), found


def believed(dynamics: Dynamics, rope: FloatArray, history: History) -> Belief:
    """From the parameters that the network takes (3,) and what actions did so far."""
    recent = history.latest(_LATEST)
    prior = np.exp(-((np.log(_GRID / _USUAL_M) / _SPREAD) ** 2) / 2)
    logs = np.log(np.concatenate([[_VISCOUS], (1 - _VISCOUS) * prior / prior.sum()]))
    reached, each = (
        np.zeros((1 + len(_GRID), 0, *recent.after.shape[1:])),
        np.zeros((1 + len(_GRID), 0)),
    )
    if len(recent.edge):
        network = dynamics.predict(recent.before, recent.edge, recent.move, rope)[None]
        reached = np.concatenate([network, _slid(_GRID, recent.before, recent.edge, recent.move)])
        each = _log_likelihoods(shape_distance(reached, recent.after), recent)
    before = logs[:, None] + np.cumsum(each, 1) - each
    foretold = [reached[_stand_ins(before[:, k])[2], k] for k in range(len(recent.edge))]
    weights, chosen, best = _stand_ins(logs + each.sum(1))
    return Belief(
        dynamics,
        rope,
        _GRID[chosen],
        weights,
        recent,
        reached[best],
        np.reshape(foretold, recent.after.shape),
    )


def _stand_ins(logs: FloatArray) -> tuple[FloatArray, IntArray, int]:
    """Of the logarithms (1 + G,) of the models' weights: the weights of the network and of the
    stiffnesses that stand for all, the indices of these, and the index of the most probable model
    of all."""
    dry = np.exp(logs[1:] - logs.max())
    chosen = _quantiles(dry)
    weights = np.concatenate(
        [[np.exp(logs[0] - logs.max())], np.full(len(chosen), dry.sum() / len(chosen))]
    )
    return (
        weights / weights.sum(),
        chosen,
        int(np.concatenate([[0], 1 + chosen])[np.argmax(weights)]),
    )


def _log_likelihoods(left: FloatArray, history: History) -> FloatArray:
    """(models, M) of the distances (models, M) that each leaves of each item."""
    moved = shape_distance(history.before, history.after)
    best = float(np.median(left / np.maximum(moved, NOISE_M), 1).min())
    noise = NOISE_M + np.clip(best, *_NOISE_SHARE) * moved
    # Heavy tails: one item that nothing explains does not decide.
    return np.asarray(-1.5 * np.log1p((left / noise) ** 2))


def _quantiles(weights: FloatArray) -> IntArray:
    """Indices that stand for the distribution in equal parts; equal ones once."""
    share = np.cumsum(weights) / weights.sum()
    return np.asarray(np.unique(np.searchsorted(share, (np.arange(_KEPT) + 0.5) / _KEPT)), np.int64)


def _slid(
    stiffness: FloatArray, states: FloatArray, edges: IntArray, moves: FloatArray
) -> FloatArray:
    """(K, B, n, 2) states after each action with dry friction, a stiffness each."""
    many, (batch, nodes) = len(stiffness), states.shape[:2]
    if not many:
        return np.zeros((0, batch, nodes, 2))
    ropes = Sliders.straight(np.repeat(stiffness, batch), nodes)
    after = slide(
        np.tile(states, (many, 1, 1)), np.tile(edges, many), np.tile(moves, (many, 1)), ropes
    )
    return after.reshape(many, batch, nodes, 2)
