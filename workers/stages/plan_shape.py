"""``plan_shape``: state and target of a DLO to ranked pick-and-place actions."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import PlanShapeRequest, PlanShapeResult
from dlo_client.contracts.shape_plans import PlanStatus, PlanWarning
from numpy.typing import NDArray

from models.manipulation.actions import Candidates
from models.manipulation.belief import Belief
from models.manipulation.chances import chance_of_half
from models.manipulation.dynamics import shape_distance
from models.manipulation.limits import Limits
from models.manipulation.planning import plan
from models.manipulation.resampling import back_to_points, node_edges_within, to_nodes
from models.manipulation.routing import fine
from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.stuck import FRUITLESS, no_progress, reason_of
from models.strands.stopwatch import Stopwatch
from workers.stages.outcome import Outcome, Tools
from workers.stages.shape_belief import belief_of
from workers.stages.shape_fixtures import among, answer_among
from workers.stages.shape_proposals import DECIMALS, Problem, outside, proposal, rounded, status
from workers.stages.shapes import check_edges, crosses_itself, learned, length_of, rope_of
from workers.stages.table import state_from_image

FloatArray = NDArray[np.float64]
_LENGTHS_DIFFER = 0.03
_LEAST_GAIN = 0.02


def run(request: PlanShapeRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    check_edges(request.history)
    with watch.step("perceive"):
        seen = state_from_image(request, tools) if request.state_m is None else None
    points = np.array(request.state_m) if seen is None else seen.points
    dynamics, models = learned(tools)
    rope = rope_of(request.object, length_of(points))
    warnings = [*rope.warnings, *(seen.warnings if seen else [])]
    fixed = among(request, points, length_of(points), rope.scale) if request.fixtures else None
    target = np.array(request.target_m) if fixed is None else fixed.goal.shape / rope.scale
    warnings += _about_shapes(points, target, request.scale_target)
    if request.scale_target and fixed is None:
        middle = to_nodes(target).mean(0)
        target = middle + (target - middle) * length_of(points) / length_of(target)
    nodes = to_nodes if fixed is None else fine
    limits = _limits(request, points, rope.scale, warnings, len(nodes(points)))
    problem = Problem(
        points, nodes(points) * rope.scale, nodes(target) * rope.scale, rope.scale, limits
    )
    tools.progress(0.3)
    with watch.step("parameters"):
        belief, used = belief_of(request, dynamics, rope, warnings)
        if fixed is None:
            warnings += _about_rest(
                belief, problem.target, request.tolerance_m * rope.scale, rope.scale
            )
    with watch.step("plan"):
        answer = (
            _answer(request, belief, problem)
            if fixed is None
            else answer_among(request, problem, fixed)
        )
    result = PlanShapeResult(
        **answer,
        state_m=rounded(points),
        target_m=rounded(target),
        parameters=used,
        valid_for_s=request.valid_for_s,
        reference=seen.reference if seen else [],
        warnings=warnings,
        models=[*models, *(seen.models if seen else [])],
    )
    return Outcome(result, timings_ms=watch.timings_ms)


def _about_shapes(points: FloatArray, target: FloatArray, scaled: bool) -> list[PlanWarning]:
    found = []
    lengths = length_of(points), length_of(target)
    if not scaled and abs(lengths[1] / lengths[0] - 1) > _LENGTHS_DIFFER:
        text = f"the state is {lengths[0]:.3f} m long, the target {lengths[1]:.3f} m; scale_target would scale it"
        found.append(PlanWarning(code="lengths_differ", field="target_m", message=text))
    for name, shape in (("state_m", points), ("target_m", target)):
        if crosses_itself(shape):
            text = "crosses itself: the model knows no contact of the DLO with itself"
            found.append(PlanWarning(code="self_crossing", field=name, message=text))
    return found


def _about_rest(
    belief: Belief, target: FloatArray, tolerance: float, scale: float
) -> list[PlanWarning]:
    back = belief.springs_back_m(target)
    if back <= tolerance:
        return []
    text = (
        "friction does not hold the DLO in this shape: put there and let go, "
        f"it springs back by {back / scale:.3f} m"
    )
    return [PlanWarning(code="springs_back", field="target_m", message=text)]


def _limits(
    request: PlanShapeRequest,
    points: FloatArray,
    scale: float,
    warnings: list[PlanWarning],
    nodes: int,
) -> Limits:
    """In the network's scale; what it was not trained for is cut off, and said.

    Without a wish an action moves a long DLO no farther than the trained range, though the network,
    scaled, would answer for more.
    """
    given, largest = request.limits, MOVE_SCALE[[0, 2]] / np.array([scale, 1.0])
    asked = (given.max_displacement_m, given.max_rotation_rad)
    for name, value, most in zip(
        ("max_displacement_m", "max_rotation_rad"), asked, largest, strict=True
    ):
        if value is not None and value > most + 1e-9:
            text = f"{value:g} is more than one action may do: {most:.3g}"
            warnings.append(
                PlanWarning(code="limits_reduced", field=f"limits.{name}", message=text)
            )
    default = np.minimum(largest, MOVE_SCALE[[0, 2]])
    shift, turn = (
        float(d if v is None else min(v, m))
        for v, d, m in zip(asked, default, largest, strict=True)
    )
    reach = given.reach_m or (0.0, float("inf"))
    return Limits(
        box=None if given.workspace_m is None else np.array(given.workspace_m) * scale,
        zones=[np.array(zone) * scale for zone in given.keep_out_m],
        base=None if given.base_xy_m is None else np.array(given.base_xy_m) * scale,
        reach=(reach[0] * scale, reach[1] * scale),
        shift=shift * scale,
        turn=turn,
        no_grasp=node_edges_within(points, given.no_grasp_edges, nodes),
        gripper=0.0 if request.gripper is None else request.gripper.width_m / 2 * scale,
    )


def _answer(request: PlanShapeRequest, belief: Belief, problem: Problem) -> dict[str, object]:
    """The fields of the result that state what to do."""
    before = float(shape_distance(problem.state, problem.target)) / problem.scale
    base: dict[str, object] = {
        "action": None,
        "alternatives": [],
        "predicted_m": None,
        "error_after_m": None,
        "error_before_m": round(before, DECIMALS),
        "converged": before <= request.tolerance_m,
    }
    if before <= request.tolerance_m:
        return base | status("done", f"the DLO is within {request.tolerance_m:g} m of the target")
    if text := outside(problem):
        return base | status("target_outside", text)
    found, ends = plan(belief, problem.state, problem.target, problem.limits, request.horizon)
    if not len(found.edge):
        return base | status("no_action", "every action for every edge breaks a limit")
    proposed = [
        proposal(problem, found, k, float(ends[k]), _chance(belief, problem, found, k), [])
        for k in range(min(len(ends), 1 + request.alternatives))
    ]
    best = proposed[0]
    if stuck := _stuck(request, problem, best.error_at_end_m, before):
        reason, text = reason_of(
            belief, problem.target, problem.limits, request.tolerance_m * problem.scale
        )
        listed = {"alternatives": proposed[: request.alternatives]}
        return (
            base
            | listed
            | {"status": PlanStatus(code="stuck", message=f"{stuck}: {text}", reason=reason)}
        )
    moved = back_to_points(
        problem.points, problem.state / problem.scale, found.predicted[0] / problem.scale
    )
    text = f"expected mean distance {best.error_after_m:.4f} m, now {before:.4f} m"
    return (
        base
        | {
            "action": best,
            "alternatives": proposed[1:],
            "predicted_m": rounded(moved),
            "error_after_m": best.error_after_m,
        }
        | status("ok", text)
    )


def _chance(belief: Belief, problem: Problem, found: Candidates, k: int) -> float:
    return chance_of_half(belief, problem.state, problem.target, int(found.edge[k]), found.move[k])


def _stuck(
    request: PlanShapeRequest, problem: Problem, at_end_m: float, before_m: float
) -> str | None:
    """What shows that the DLO comes no nearer to the target; None where it may."""
    if at_end_m > (1 - _LEAST_GAIN) * before_m:
        return f"the best actions leave {at_end_m:.4f} m of {before_m:.4f} m"
    tried = request.history[-request.tried :] if request.tried else []
    states = [
        to_nodes(np.array(points)) * problem.scale
        for item in tried
        for points in (item.before, item.after)
    ]
    if states and no_progress(shape_distance(np.array(states), problem.target).reshape(-1, 2)):
        return f"the last {FRUITLESS} actions brought the DLO no nearer than it was"
    return None
