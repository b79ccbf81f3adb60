"""``plan_shape`` among pegs, clips and edges: from the request's fixtures and route to an
answer."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dlo_client.contracts import PlanLimits, PlanShapeRequest
from dlo_client.contracts.fixtures import Clip as ClipGiven
from dlo_client.contracts.fixtures import Peg, TableEdge
from dlo_client.contracts.shape_plans import PlanCheck, PlanStatus, StuckReason
from numpy.typing import NDArray

from models.geometry.polylines import arc_lengths
from models.manipulation.actions import Candidates
from models.manipulation.fixtures import Clip, Fixtures
from models.manipulation.limits import Limits
from models.manipulation.resampling import back_to_points, node_edge_of
from models.manipulation.routes import Impossible, Route, Stop
from models.manipulation.routing import FINE, Goal, World, fine, likely_stiffness, routed
from models.manipulation.stuck import no_progress
from workers.stages.outcome import InvalidInput
from workers.stages.shape_proposals import DECIMALS, Problem, outside, proposal, rounded, status

FloatArray = NDArray[np.float64]
_DIAMETER_SHARE = 0.01
_WALL_M = 1e-3
"""Half of the thickness of an edge."""
_DEEPEST_M = 3e-3
"""In a fixture, of a state that was seen not quite exactly."""
_CROSSING_M = 1e-6
_LATEST = 4
"""Items of the history from which the stiffness is taken."""


@dataclass(frozen=True, eq=False)
class Among:
    """Fixtures in the network's scale, and what the DLO should be among them."""

    fixtures: Fixtures
    goal: Goal


def among(request: PlanShapeRequest, points: FloatArray, length_m: float, scale: float) -> Among:
    """The goal for a DLO whose points (N, 2) m are known. Raises InvalidInput naming what is
    impossible."""
    diameter = request.object.diameter_m or _DIAMETER_SHARE * length_m
    for k, fixture in enumerate(request.fixtures):
        if isinstance(fixture, ClipGiven) and fixture.width_m <= diameter:
            text = f"is {fixture.width_m:g} m, the DLO is taken to be {diameter:.3g} m thick (`object.diameter_m`)"
            raise InvalidInput(f"fixtures.{k}.width_m", text, "invalid_fixture")
    fixtures = _fixtures(request, diameter, scale)
    _check_free(request, fixtures, fine(points) * scale, "state_m", scale)
    if request.route is None:
        shape = (
            _shape(np.array(request.target_m), length_m if request.scale_target else None) * scale
        )
        _check_free(request, fixtures, shape, "target_m", scale)
        return Among(fixtures, Goal(shape))
    route = _route(request, fixtures, points, scale)
    try:
        shape = route.shape(length_m * scale, FINE)
    except Impossible as error:
        field = "route" if error.stop is None else f"route.stops.{error.stop}"
        text = (
            str(error)
            if error.needed is None
            else f"is {error.needed / scale:.3f} m long, the DLO {length_m:.3f} m"
        )
        raise InvalidInput(field, text, "invalid_route") from error
    _check_free(request, fixtures, shape, "route", scale)
    return Among(fixtures, Goal(shape, route))


def _shape(target: FloatArray, length_m: float | None) -> FloatArray:
    """(31, 2) m of a target, with another length about its middle if one is given."""
    shape = fine(target)
    if length_m is None:
        return shape
    middle = shape.mean(0)
    return np.asarray(middle + (shape - middle) * length_m / arc_lengths(shape)[-1])


def _fixtures(request: PlanShapeRequest, diameter: float, scale: float) -> Fixtures:
    solid = [f for f in request.fixtures if not isinstance(f, ClipGiven)]
    ends = [(f.xy_m, f.xy_m) if isinstance(f, Peg) else (f.from_m, f.to_m) for f in solid]
    radii = [(f.radius_m if isinstance(f, Peg) else _WALL_M) + diameter / 2 for f in solid]
    places = np.array(ends, np.float64).reshape(-1, 2, 2) * scale
    clips = [_clip(f, diameter, scale) for f in request.fixtures if isinstance(f, ClipGiven)]
    return Fixtures(places[:, 0], places[:, 1], np.array(radii) * scale, clips)


def _clip(given: ClipGiven, diameter: float, scale: float) -> Clip:
    play = (given.width_m - diameter) / 2
    return Clip(np.array(given.xy_m) * scale, given.angle_rad, play * scale, given.length_m * scale)


def _route(
    request: PlanShapeRequest, fixtures: Fixtures, points: FloatArray, scale: float
) -> Route:
    given = request.route
    assert given is not None
    solid = [k for k, f in enumerate(request.fixtures) if not isinstance(f, ClipGiven)]
    clips = [k for k, f in enumerate(request.fixtures) if isinstance(f, ClipGiven)]
    stops = []
    for stop in given.stops:
        fixture = request.fixtures[stop.fixture]
        assert not isinstance(fixture, TableEdge)
        xy = np.array(fixture.xy_m) * scale
        if isinstance(fixture, Peg):
            radius = float(fixtures.radius[solid.index(stop.fixture)])
            stops.append(Stop(xy, radius, 1 if stop.side == "left" else -1))
        else:
            stops.append(Stop(xy, clip=fixtures.clips[clips.index(stop.fixture)]))
    start = points[0] if given.start_m is None else np.array(given.start_m)
    end = None if given.end_m is None else np.array(given.end_m) * scale
    return Route(stops, given.slack_m * scale, start * scale, end)


def _check_free(
    request: PlanShapeRequest, fixtures: Fixtures, shape: FloatArray, field: str, scale: float
) -> None:
    """Raises InvalidInput where a DLO (31, 2) passes through a peg or an edge."""
    depth = -fixtures.gap(shape[:-1], shape[1:]).min(0, initial=np.inf)
    through = (depth > _DEEPEST_M) | (depth >= fixtures.radius - _CROSSING_M)
    if not through.any():
        return
    solid = [k for k, f in enumerate(request.fixtures) if not isinstance(f, ClipGiven)]
    worst = int(np.argmax(np.where(through, depth, -1.0)))
    text = f"passes through fixtures.{solid[worst]}, by {1e3 * depth[worst] / scale:.1f} mm"
    raise InvalidInput(field, text, "invalid_route" if field == "route" else "invalid_shape")


def answer_among(request: PlanShapeRequest, problem: Problem, found: Among) -> dict[str, object]:
    """The fields of the result that state what to do; ``problem`` in 31 nodes."""
    goal, fixtures, scale, state = found.goal, found.fixtures, problem.scale, problem.state
    before = float(goal.away(state[None], fixtures)[0])
    tolerance = request.tolerance_m * scale
    base: dict[str, object] = {
        "action": None,
        "alternatives": [],
        "predicted_m": None,
        "error_after_m": None,
        "error_before_m": round(before / scale, DECIMALS),
        "converged": goal.reached(state, fixtures, tolerance),
        "stops_left": [] if goal.route is None else goal.route.missed(state),
    }
    if base["converged"]:
        what = (
            f"within {request.tolerance_m:g} m of the target"
            if goal.route is None
            else "on the route"
        )
        return base | status("done", f"the DLO is {what}")
    if text := outside(problem):
        return base | status("target_outside", text)
    world = World(fixtures, problem.limits, _stiffness(request, fixtures, scale))
    actions = routed(world, state, goal, 1 + request.alternatives)
    if not len(actions.edge):
        return base | status(
            "no_action", "every action breaks a limit, or jams the DLO at a fixture"
        )
    return base | _planned(request, problem, found, actions, before)


def _planned(
    request: PlanShapeRequest, problem: Problem, found: Among, actions: Candidates, before: float
) -> dict[str, object]:
    goal, fixtures, scale = found.goal, found.fixtures, problem.scale
    cost = float(goal.cost(problem.state[None], fixtures)[0])
    away = goal.away(actions.predicted, fixtures)
    gain = float(actions.error[0]) < cost
    actions = replace(actions, error=away)
    clear = [PlanCheck(name="fixtures", passed=True)]
    proposed = [
        proposal(problem, actions, k, float(away[k]), None, clear) for k in range(len(away))
    ]
    if not gain or _fruitless(request, goal, fixtures, scale):
        listed = {"alternatives": proposed[: request.alternatives]}
        text = "no action that was looked at brings the DLO nearer to the route or the target"
        reason: StuckReason = "limits" if request.limits != PlanLimits() else "local_optimum"
        return listed | {"status": PlanStatus(code="stuck", message=text, reason=reason)}
    moved = back_to_points(problem.points, problem.state / scale, actions.predicted[0] / scale)
    text = f"expected mean way {away[0] / scale:.4f} m, now {before / scale:.4f} m"
    return {
        "action": proposed[0],
        "alternatives": proposed[1:],
        "predicted_m": rounded(moved),
        "error_after_m": proposed[0].error_after_m,
    } | status("ok", text)


def _fruitless(request: PlanShapeRequest, goal: Goal, fixtures: Fixtures, scale: float) -> bool:
    """Whether the last actions that aimed at this goal brought nothing."""
    tried = request.history[-request.tried :] if request.tried else []
    states = [
        fine(np.array(points)) * scale for item in tried for points in (item.before, item.after)
    ]
    return bool(states) and no_progress(goal.cost(np.array(states), fixtures).reshape(-1, 2))


def _stiffness(request: PlanShapeRequest, fixtures: Fixtures, scale: float) -> float:
    items = request.history[-_LATEST:]
    before = np.array([fine(np.array(i.before)) for i in items]).reshape(-1, FINE, 2) * scale
    after = np.array([fine(np.array(i.after)) for i in items]).reshape(-1, FINE, 2) * scale
    edges = np.array(
        [node_edge_of(np.array(i.before), i.action.edge, FINE) for i in items], np.int64
    )
    moves = [[i.action.dx_m * scale, i.action.dy_m * scale, i.action.dtheta_rad] for i in items]
    world = World(fixtures, Limits())
    return likely_stiffness(world, before, edges, np.array(moves).reshape(-1, 3), after)
