"""How probable it is that an action brings at least half of what is expected of it.

Strategy: what is foreseen has a spread, of the models that may be right and of the share by which
motions were not as foretold; how often earlier actions of the same DLO ended farther from the
target than foretold moves what is to be expected.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from models.manipulation.belief import NOISE_M, Belief
from models.manipulation.dynamics import shape_distance
from models.manipulation.frames import FloatArray

_SUPPOSED = 1.0
"""Items without optimism that are supposed before any is seen."""
_SPREADS = 2.0
"""By which a whole motion of optimism moves what is to be expected."""


def chance_of_half(
    belief: Belief, state: FloatArray, target: FloatArray, edge: int, move: FloatArray
) -> float:
    """For states (n, 2) m: move (3,) of ``edge`` brings half of the expected gain, 0 to 1."""
    reached = belief.predict(state[None], np.array([edge]), move[None])[:, 0]
    error = shape_distance(reached, target)
    expected = float(belief.weights @ error)
    between = float(belief.weights @ (error - expected) ** 2)
    moved = float(belief.weights @ shape_distance(reached, state))
    spread = np.sqrt(between + (belief.surprising * moved) ** 2 + NOISE_M**2)
    half = 0.5 * (float(shape_distance(state, target)) - expected)
    return float(ndtr(half / spread - _SPREADS * optimism(belief, target)))


def optimism(belief: Belief, target: FloatArray) -> float:
    """Share of the motions by which actions ended farther from the target than was foretold; 0
    where none was seen, and where they ended nearer: that promises nothing."""
    history = belief.history
    if not len(history.edge):
        return 0.0
    moved = np.maximum(shape_distance(history.before, history.after), NOISE_M)
    foretold, came = (shape_distance(s, target) for s in (belief.foretold_m, history.after))
    share = np.clip((came - foretold) / moved, -1.0, 1.0)
    return max(float(share.sum()) / (len(share) + _SUPPOSED), 0.0)
