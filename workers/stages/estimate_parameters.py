"""``estimate_parameters``: actions and what they did, to k_b and k_d."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import EstimateParametersRequest, EstimateParametersResult

from models.manipulation.belief import believed
from models.manipulation.dynamics import Dynamics
from models.manipulation.parameters import Estimate, History, estimate
from models.strands.stopwatch import Stopwatch
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.shape_belief import about_history, friction_of
from workers.stages.shapes import check_edges, history_of, learned, length_of, rope_of

_NO_ROPE = (
    "holds states that no rope model can move: do nodes lie upon each other, are units right?"
)


def run(request: EstimateParametersRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    dynamics, models = learned(tools)
    check_edges(request.history)
    rope = rope_of(request.object, length_of(np.array(request.history[0].before)))
    history = history_of(request.history, rope.scale)
    with watch.step("estimate"):
        length = request.object.length_m
        found = _estimated(
            dynamics, history, rope.mass, None if length is None else length * rope.scale
        )
        belief = believed(dynamics, found.rope(rope.mass), history)
    errors = found.error_m / rope.scale
    result = EstimateParametersResult(
        **friction_of(belief, rope.scale),
        k_b=round(found.bending, 6),
        k_d=round(found.damping, 6),
        sigma=(round(float(found.sigma[0]), 4), round(float(found.sigma[1]), 4)),
        ratio_sigma=round(found.ratio_sigma, 4),
        loss_m=round(float(errors.mean()), 6),
        loss_mid_range_m=round(float(found.error_before_m.mean()) / rope.scale, 6),
        sample_errors_m=np.round(errors, 6).tolist(),
        warnings=rope.warnings
        + about_history(belief, history, found.error_m, rope.scale, len(history.edge)),
        models=models,
    )
    return Outcome(result, timings_ms=watch.timings_ms)


def _estimated(dynamics: Dynamics, history: History, mass: float, length: float | None) -> Estimate:
    """Raises InvalidInput where the rope model leads nowhere: nodes that lie upon each other have
    no direction."""
    try:
        found = estimate(dynamics, history, mass, length)
    except np.linalg.LinAlgError as error:
        raise InvalidInput("history", _NO_ROPE, "invalid_history") from error
    if not np.isfinite(
        [found.bending, found.damping, *found.sigma, *found.error_m, *found.error_before_m]
    ).all():
        raise InvalidInput("history", _NO_ROPE, "invalid_history")
    return found
