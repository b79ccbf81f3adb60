"""``plan_shape``: state and target of a DLO to ranked pick-and-place actions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import PlannedAction, PlanShapeRequest, PlanShapeResult
from dlo_client.contracts.manipulation import (
    GripPose,
    PlanCheck,
    PlanCode,
    PlanStatus,
    PlanWarning,
)
from numpy.typing import NDArray

from models.manipulation.actions import Candidates
from models.manipulation.belief import Belief
from models.manipulation.dynamics import shape_distance
from models.manipulation.limits import Limits, checks, dense, inside
from models.manipulation.planning import plan
from models.manipulation.resampling import back_to_points, edge_of_points, node_edges_within, to_nodes
from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.stuck import FRUITLESS, no_progress, reason_of
from models.strands.stopwatch import Stopwatch
from workers.stages.outcome import Outcome, Tools
from workers.stages.shape_belief import belief_of
from workers.stages.shapes import check_edges, crosses_itself, learned, length_of, rope_of
from workers.stages.table import state_from_image

FloatArray = NDArray[np.float64]
_LENGTHS_DIFFER = 0.03
_LEAST_GAIN = 0.02
_DECIMALS = 6


@dataclass(frozen=True)
class _Problem:
    """State and target as given (N, 2), and as nodes in the network's scale."""

    points: FloatArray
    state: FloatArray
    target: FloatArray
    scale: float
    limits: Limits


def run(request: PlanShapeRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    check_edges(request.history)
    target = np.array(request.target_m)
    with watch.step("perceive"):
        seen = state_from_image(request, target, tools) if request.state_m is None else None
    points = np.array(request.state_m) if seen is None else seen.points
    dynamics, models = learned(tools)
    rope = rope_of(request.object, length_of(points))
    warnings = [*rope.warnings, *(seen.warnings if seen else [])]
    warnings += _about_shapes(points, target, request.scale_target)
    if request.scale_target:
        middle = to_nodes(target).mean(0)
        target = middle + (target - middle) * length_of(points) / length_of(target)
    limits = _limits(request, points, rope.scale, warnings)
    problem = _Problem(points, to_nodes(points) * rope.scale, to_nodes(target) * rope.scale, rope.scale, limits)
    tools.progress(0.3)
    with watch.step("parameters"):
        belief, used = belief_of(request, dynamics, rope, warnings)
        warnings += _about_rest(belief, problem.target, request.tolerance_m * rope.scale, rope.scale)
    with watch.step("plan"):
        answer = _answer(request, belief, problem)
    result = PlanShapeResult(
        **answer,
        state_m=_rounded(points),
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


def _about_rest(belief: Belief, target: FloatArray, tolerance: float, scale: float) -> list[PlanWarning]:
    back = belief.springs_back_m(target)
    if back <= tolerance:
        return []
    text = (
        f"friction does not hold the DLO in this shape: put there and let go, it springs back by {back / scale:.3f} m"
    )
    return [PlanWarning(code="springs_back", field="target_m", message=text)]


def _limits(request: PlanShapeRequest, points: FloatArray, scale: float, warnings: list[PlanWarning]) -> Limits:
    """In the network's scale; what it was not trained for is cut off, and said.

    Without a wish an action moves a long DLO no farther than the trained range, though the network, scaled, would
    answer for more.
    """
    given, largest = request.limits, MOVE_SCALE[[0, 2]] / np.array([scale, 1.0])
    asked = (given.max_displacement_m, given.max_rotation_rad)
    for name, value, most in zip(("max_displacement_m", "max_rotation_rad"), asked, largest, strict=True):
        if value is not None and value > most + 1e-9:
            text = f"{value:g} is more than one action may do: {most:.3g}"
            warnings.append(PlanWarning(code="limits_reduced", field=f"limits.{name}", message=text))
    default = np.minimum(largest, MOVE_SCALE[[0, 2]])
    shift, turn = (float(d if v is None else min(v, m)) for v, d, m in zip(asked, default, largest, strict=True))
    reach = given.reach_m or (0.0, float("inf"))
    return Limits(
        box=None if given.workspace_m is None else np.array(given.workspace_m) * scale,
        zones=[np.array(zone) * scale for zone in given.keep_out_m],
        base=None if given.base_xy_m is None else np.array(given.base_xy_m) * scale,
        reach=(reach[0] * scale, reach[1] * scale),
        shift=shift * scale,
        turn=turn,
        no_grasp=node_edges_within(points, given.no_grasp_edges),
    )


def _answer(request: PlanShapeRequest, belief: Belief, problem: _Problem) -> dict[str, object]:
    """The fields of the result that state what to do."""
    before = float(shape_distance(problem.state, problem.target)) / problem.scale
    base: dict[str, object] = {
        "action": None, "alternatives": [], "predicted_m": None, "error_after_m": None,
        "error_before_m": round(before, _DECIMALS), "converged": before <= request.tolerance_m,
    }  # fmt: skip
    if before <= request.tolerance_m:
        return base | _status("done", f"the DLO is within {request.tolerance_m:g} m of the target")
    if outside := _outside(problem):
        return base | _status("target_outside", outside)
    found, ends = plan(belief, problem.state, problem.target, problem.limits, request.horizon)
    if not len(found.edge):
        return base | _status("no_action", "every action for every edge breaks a limit")
    proposed = [_proposal(problem, belief, found, ends, k) for k in range(min(len(ends), 1 + request.alternatives))]
    best = proposed[0]
    if stuck := _stuck(request, problem, best.error_at_end_m, before):
        reason, text = reason_of(belief, problem.target, problem.limits, request.tolerance_m * problem.scale)
        listed = {"alternatives": proposed[: request.alternatives]}
        return base | listed | {"status": PlanStatus(code="stuck", message=f"{stuck}: {text}", reason=reason)}
    moved = back_to_points(problem.points, problem.state / problem.scale, found.predicted[0] / problem.scale)
    text = f"expected mean distance {best.error_after_m:.4f} m, now {before:.4f} m"
    return base | {
        "action": best,
        "alternatives": proposed[1:],
        "predicted_m": _rounded(moved),
        "error_after_m": best.error_after_m,
    } | _status("ok", text)  # fmt: skip


def _stuck(request: PlanShapeRequest, problem: _Problem, at_end_m: float, before_m: float) -> str | None:
    """What shows that the DLO comes no nearer to the target; None where it may."""
    if at_end_m > (1 - _LEAST_GAIN) * before_m:
        return f"the best actions leave {at_end_m:.4f} m of {before_m:.4f} m"
    tried = request.history[-request.tried :] if request.tried else []
    states = [to_nodes(np.array(points)) * problem.scale for item in tried for points in (item.before, item.after)]
    if states and no_progress(shape_distance(np.array(states), problem.target).reshape(-1, 2)):
        return f"the last {FRUITLESS} actions brought the DLO no nearer than it was"
    return None


def _status(code: PlanCode, message: str) -> dict[str, object]:
    return {"status": PlanStatus(code=code, message=message)}


def _outside(problem: _Problem) -> str | None:
    """Which limit the target itself breaks."""
    points, limits = dense(problem.target), problem.limits
    if limits.box is not None and not np.all((points >= limits.box[0]) & (points <= limits.box[1])):
        return "the target leaves limits.workspace_m"
    for k, zone in enumerate(limits.zones):
        if inside(points, zone).any():
            return f"the target enters limits.keep_out_m.{k}"
    return None


def _proposal(problem: _Problem, belief: Belief, found: Candidates, ends: FloatArray, k: int) -> PlannedAction:
    edge, move, scale = int(found.edge[k]), found.move[k], problem.scale
    pair = problem.state[edge : edge + 2] / scale
    shift = move[:2] / scale
    middle, angle = pair.mean(0), float(np.arctan2(*(pair[1] - pair[0])[::-1]))
    return PlannedAction(
        edge=edge_of_points(problem.points, edge),
        dx_m=round(float(shift[0]), _DECIMALS),
        dy_m=round(float(shift[1]), _DECIMALS),
        dtheta_rad=round(float(move[2]), _DECIMALS),
        pick=_grip(middle, angle),
        place=_grip(middle + shift, angle + float(move[2])),
        error_after_m=round(float(found.error[k]) / scale, _DECIMALS),
        error_at_end_m=round(float(ends[k]) / scale, _DECIMALS),
        converged=bool(found.converged[k]),
        probability=round(belief.chance_of_half(problem.state, problem.target, edge, move), 4),
        checks=[
            PlanCheck.model_validate({"name": c.name, "passed": c.passed})
            for c in checks(problem.state, found, k, problem.limits)
        ],
    )


def _grip(xy: FloatArray, angle: float) -> GripPose:
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    return GripPose(xy_m=(round(float(xy[0]), _DECIMALS), round(float(xy[1]), _DECIMALS)), angle_rad=round(wrapped, 6))


def _rounded(points: FloatArray) -> list[tuple[float, float]]:
    return [(x, y) for x, y in np.round(points, _DECIMALS).tolist()]
