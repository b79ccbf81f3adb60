"""How probable it is that an action brings at least half of what is expected of it.

Strategy: a logistic model over a few measurements, among them how well earlier actions of the same
DLO were foretold. Its coefficients are in ``chances.toml``, which
``python -m models.training.dynamics.chances`` writes from tasks in simulators that the planner's
models do not describe.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import numpy as np

from models.manipulation.belief import NOISE_M, Belief
from models.manipulation.dynamics import shape_distance
from models.manipulation.frames import FloatArray

COEFFICIENTS = Path(__file__).with_name("chances.toml")
FEATURES = ("one", "steady", "gain", "surprising", "unseen", "optimism", "dry")
_LEAST_M = 1e-4
_TRUSTED = 2.0
"""Items of the history after which their mean optimism counts two thirds."""
_MOST_SPREADS = 4.0


def chance_of_half(belief: Belief, state: FloatArray, target: FloatArray, edge: int, move: FloatArray) -> float:
    """For states (n, 2) m: move (3,) of ``edge`` brings half of the expected gain, 0 to 1."""
    logit = float(evidence(belief, state, target, edge, move) @ _weights())
    return float(1 / (1 + np.exp(-np.clip(logit, -30, 30))))


def evidence(belief: Belief, state: FloatArray, target: FloatArray, edge: int, move: FloatArray) -> FloatArray:
    """(7,) of :data:`FEATURES`.

    ``steady``: half of the gain over the spread of what is foreseen; ``gain``: logarithm of its
    share of the distance; ``surprising``: the share by which motions were not as foretold;
    ``unseen``: less with every action seen; ``optimism``: how much nearer to the target actions
    were foretold to end than they did; ``dry``: friction is taken for dry.
    """
    reached = belief.predict(state[None], np.array([edge]), move[None])[:, 0]
    error, before = shape_distance(reached, target), float(shape_distance(state, target))
    expected = float(belief.weights @ error)
    between = float(belief.weights @ (error - expected) ** 2)
    moved = float(belief.weights @ shape_distance(reached, state))
    surprising = belief.surprising
    spread = np.sqrt(between + (surprising * moved) ** 2 + NOISE_M**2)
    gain = max(before - expected, _LEAST_M)
    return np.array([
        1.0,
        min(0.5 * gain / spread, _MOST_SPREADS),
        np.log(gain / max(before, _LEAST_M)),
        surprising,
        1 / (1 + len(belief.history.edge)),
        optimism(belief, target),
        float(belief.best > 0),
    ])  # fmt: skip


def optimism(belief: Belief, target: FloatArray) -> float:
    """Share of the motions by which actions ended farther from the target than was foretold; 0
    where none was seen."""
    history = belief.history
    if not len(history.edge):
        return 0.0
    moved = np.maximum(shape_distance(history.before, history.after), NOISE_M)
    foretold, came = (shape_distance(s, target) for s in (belief.foretold_m, history.after))
    share = np.clip((came - foretold) / moved, -1.0, 1.0)
    return float(share.sum() / (len(share) + _TRUSTED / 2))


@cache
def _weights() -> FloatArray:
    stored = tomllib.loads(COEFFICIENTS.read_text())["half"]
    return np.array([stored[name] for name in FEATURES])
