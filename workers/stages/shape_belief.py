"""What ``plan_shape`` takes the DLO and its table for, from the request's parameters and
history."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import PlanShapeRequest
from dlo_client.contracts.shape_plans import PlanWarning, UsedParameters
from numpy.typing import NDArray

from models.manipulation.belief import LEARNED_FROM, Belief, learned
from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.parameters import MID_RANGE, History
from models.manipulation.simulator import BENDING, DAMPING
from models.manipulation.stuck import unlike_any_model
from workers.stages.shapes import Rope, contradictions, history_of

FloatArray = NDArray[np.float64]
_DECIMALS = 6


def belief_of(
    request: PlanShapeRequest, dynamics: Dynamics, rope: Rope, warnings: list[PlanWarning]
) -> tuple[Belief, UsedParameters]:
    """Parameters of the request are taken as certain; ``warnings`` grows."""
    if request.parameters is not None:
        used = _given(request, warnings)
        return Belief.certain(dynamics, np.array([rope.mass, used.k_b, used.k_d])), used
    history = history_of(request.history, rope.scale)
    length = request.object.length_m
    belief, found = learned(
        dynamics, history, rope.mass, None if length is None else length * rope.scale
    )
    parts: dict[str, object] = {"k_b": MID_RANGE[0], "k_d": MID_RANGE[1], "source": "mid_range"}
    if request.history:
        warnings += about_history(
            belief, history.latest(LEARNED_FROM), found.error_m, rope.scale, len(history.edge)
        )
        k_b, k_d = round(found.bending, _DECIMALS), round(found.damping, _DECIMALS)
        sigma = tuple(round(float(s), 4) for s in found.sigma)
        parts = {"k_b": k_b, "k_d": k_d, "sigma": sigma, "source": "history"}
    return belief, UsedParameters.model_validate(parts | friction_of(belief, rope.scale))


def _given(request: PlanShapeRequest, warnings: list[PlanWarning]) -> UsedParameters:
    given = request.parameters
    assert given is not None
    k_b, k_d = float(np.clip(given.k_b, *BENDING)), float(np.clip(given.k_d, *DAMPING))
    if (k_b, k_d) != (given.k_b, given.k_d):
        text = f"outside the trained k_b {BENDING[0]} to {BENDING[1]}, k_d {DAMPING[0]:g} to {DAMPING[1]:g}: cut"
        warnings.append(PlanWarning(code="parameters_untrained", field="parameters", message=text))
    return UsedParameters(k_b=k_b, k_d=k_d, source="request")


def friction_of(belief: Belief, scale: float) -> dict[str, object]:
    """The more probable kind, its probability, and with dry friction the stiffness over it: fields
    of an answer."""
    viscous = float(belief.weights[0])
    if belief.best == 0:
        return {"friction": "viscous", "friction_probability": round(viscous, 4)}
    stiffness = round(float(belief.stiffness[belief.best - 1]) / scale, 4)
    return {
        "friction": "dry",
        "friction_probability": round(1 - viscous, 4),
        "stiffness_m": stiffness,
    }


def about_history(
    belief: Belief, history: History, errors_m: FloatArray, scale: float, items: int
) -> list[PlanWarning]:
    """Items that neither kind of friction explains, of the last of so many items; and a DLO like
    none that is known."""
    left = errors_m.copy()
    latest = slice(len(left) - len(belief.residual_m), None)
    left[latest] = np.minimum(left[latest], belief.residual_m)
    found = contradictions(
        left / scale, shape_distance(history.before, history.after) / scale, items
    )
    if unlike_any_model(belief):
        text = f"the DLO moves like none that is known: {100 * belief.unexplained:.0f} % of its motion is unexplained"
        found.append(PlanWarning(code="unlike_any_model", field="history", message=text))
    return found
