"""``plan_shape`` and ``estimate_parameters`` through the stages: good input, every kind of bad
input."""

from __future__ import annotations

import re

import numpy as np
import pytest
from dlo_client.contracts import (
    DloObject,
    EstimateParametersRequest,
    Experience,
    MoveAction,
    PlanLimits,
    RopeParameters,
)
from dlo_client.demo.simulated_table import target_shape
from pydantic import ValidationError

from models.manipulation.simulator import Actions, Ropes, simulate, straight
from models.manipulation.sliding import Sliders, slide
from tests.workers.planning_requests import LENGTH, OBJECT, U, line, request, run
from workers import stages
from workers.stages.outcome import InvalidInput


def codes(result) -> set[str]:
    return {warning.code for warning in result.warnings}


def experience(k_b: float = 0.1, k_d: float = 20.0, count: int = 4) -> list[Experience]:
    """What a simulated rope does."""
    rope, rng = Ropes.same(1, 0.05, k_b, k_d, LENGTH), np.random.default_rng(3)
    state, items = straight(rope.length, 16), []
    for _ in range(count):
        act = Actions.random(rng, 1, 16)
        after = simulate(state, act, rope)
        (dx, dy), turn = act.shift[0], act.turn[0]
        done = MoveAction(edge=int(act.edge[0]), dx_m=dx, dy_m=dy, dtheta_rad=turn)
        items.append(Experience(before=state[0].tolist(), action=done, after=after[0].tolist()))
        state = after
    return items


def test_an_action_that_helps(tools):
    result = run(tools)
    assert result.status.code == "ok"
    action = result.action
    assert result.error_after_m < 0.7 * result.error_before_m
    assert {c.name for c in action.checks} == {"displacement", "rotation"}
    assert all(c.passed for c in action.checks)
    assert len(result.alternatives) == 3
    assert [a.error_after_m for a in result.alternatives] == sorted(
        a.error_after_m for a in result.alternatives
    )
    assert len({action.edge, *(a.edge for a in result.alternatives)}) == 4
    assert result.parameters.source == "mid_range"
    assert len(result.predicted_m) == 16
    assert len(result.models) == 3
    middle = np.mean(line()[action.edge : action.edge + 2], axis=0)
    assert action.pick.xy_m == pytest.approx(middle, abs=1e-5)
    assert action.place.xy_m == pytest.approx(
        middle + np.array([action.dx_m, action.dy_m]), abs=1e-5
    )
    assert action.place.angle_rad - action.pick.angle_rad == pytest.approx(
        action.dtheta_rad, abs=1e-5
    )


def test_equal_requests_have_equal_answers(tools):
    first, second = (
        stages.run(request(horizon=2, history=experience()), tools).result for _ in "ab"
    )
    assert first.model_dump_json() == second.model_dump_json()


def test_a_longer_look_is_no_worse(tools):
    assert run(tools, horizon=2).action.error_at_end_m <= run(tools).action.error_at_end_m


@pytest.mark.parametrize("points", [2, 5, 33, 1000])
def test_any_number_of_points(tools, points):
    """Points between are taken along; the edge counts along what was given."""
    result = run(tools, state_m=line(points))
    assert result.status.code == "ok"
    assert len(result.predicted_m) == len(result.state_m) == points
    assert 0 <= result.action.edge <= points - 2
    near = line(points)[result.action.edge : result.action.edge + 2]
    assert near[0][0] - 1e-6 <= result.action.pick.xy_m[0] <= near[1][0] + 1e-6


def test_repeated_points_change_nothing(tools):
    plain = run(tools)
    doubled = run(tools, state_m=[line()[0], *line()])
    assert doubled.action.model_dump(exclude={"edge"}) == plain.action.model_dump(exclude={"edge"})
    assert doubled.action.edge == plain.action.edge + 1


def test_the_target_reached_needs_no_action(tools):
    result = run(tools, state_m=U)
    assert (result.status.code, result.action, result.converged) == ("done", None, True)


def test_a_target_of_another_length_is_said_and_scaled_only_when_asked(tools):
    longer = target_shape("U", 0.6)
    assert "lengths_differ" in codes(run(tools, target_m=longer))
    scaled = run(tools, target_m=longer, scale_target=True)
    assert "lengths_differ" not in codes(scaled)
    assert scaled.error_before_m == pytest.approx(run(tools).error_before_m, abs=1e-3)


def test_a_state_that_crosses_itself_is_said(tools):
    loop = [(0.1 * np.cos(t), 0.1 * np.sin(t) + 0.02 * t) for t in np.linspace(0, 7, 20)]
    found = [w.field for w in run(tools, state_m=loop).warnings if w.code == "self_crossing"]
    assert found == ["state_m"]


@pytest.mark.parametrize(
    ("fields", "code", "field"),
    [
        ({"object": DloObject(mass_kg=1.0)}, "mass_untrained", "object.mass_kg"),
        ({"object": DloObject(mass_kg=0.001)}, "mass_untrained", "object.mass_kg"),
        (
            {"state_m": line(16, 2.0), "target_m": target_shape("U", 2.0)},
            "length_untrained",
            "object.length_m",
        ),
        (
            {"state_m": line(16, 0.05), "target_m": target_shape("U", 0.05)},
            "length_untrained",
            "object.length_m",
        ),
        ({"parameters": RopeParameters(k_b=50, k_d=14)}, "parameters_untrained", "parameters"),
        (
            {"limits": PlanLimits(max_displacement_m=0.5)},
            "limits_reduced",
            "limits.max_displacement_m",
        ),
    ],
)
def test_what_was_not_trained_is_answered_with_a_warning(tools, fields, code, field):
    result = run(tools, tolerance_m=1e-4, **fields)
    assert (code, field) in {(w.code, w.field) for w in result.warnings}
    assert result.action is not None


def test_a_long_dlo_is_planned_for_in_its_own_meters(tools):
    """Four times as long: four times the way, where so much is allowed; the same turn."""
    wide = PlanLimits(max_displacement_m=0.4)
    known = {"parameters": RopeParameters(k_b=0.5, k_d=14)}
    near = run(tools, **known)
    far = run(tools, state_m=line(16, 1.8), target_m=target_shape("U", 1.8), limits=wide, **known)
    assert far.action.edge == near.action.edge
    assert far.action.dtheta_rad == pytest.approx(near.action.dtheta_rad, abs=0.1)
    assert far.action.dx_m == pytest.approx(4 * near.action.dx_m, abs=0.03)
    assert abs(far.action.dy_m) > 0.1


def test_limits_are_kept_and_named(tools):
    limits = PlanLimits(
        workspace_m=((-0.3, -0.2), (0.3, 0.2)),
        keep_out_m=[[(0.26, 0.1), (0.3, 0.1), (0.3, 0.2)]],
        base_xy_m=(0.0, -0.3),
        reach_m=(0.1, 0.6),
        max_displacement_m=0.04,
        max_rotation_rad=0.2,
        no_grasp_edges=[0, 1],
    )
    result = run(tools, limits=limits)
    names = ["displacement", "rotation", "workspace", "reach", "keep_out", "grasp"]
    for action in [result.action, *result.alternatives]:
        assert [c.name for c in action.checks] == names
        assert all(c.passed for c in action.checks)
        assert action.edge > 1
        assert max(abs(action.dx_m), abs(action.dy_m)) <= 0.04 + 1e-9
        assert abs(action.dtheta_rad) <= 0.2 + 1e-9


@pytest.mark.parametrize(
    ("limits", "code", "said"),
    [
        (PlanLimits(workspace_m=((-0.3, -0.01), (0.3, 0.01))), "target_outside", "workspace_m"),
        (
            PlanLimits(keep_out_m=[[(-1, -1), (1, -1), (1, 1), (-1, 1)]]),
            "target_outside",
            r"keep_out_m\.0",
        ),
        (PlanLimits(base_xy_m=(9, 9), reach_m=(0, 1)), "no_action", "limit"),
    ],
)
def test_a_reason_when_there_is_no_action(tools, limits, code, said):
    result = run(tools, limits=limits)
    assert result.status.code == code
    assert result.action is None
    assert re.search(said, result.status.message)


def test_stuck_where_nothing_helps(tools):
    far = [(x + 50, y) for x, y in U]
    held = PlanLimits(max_displacement_m=0.001, max_rotation_rad=0.0)
    result = run(tools, target_m=far, limits=held)
    assert (result.status.code, result.status.reason, result.action) == ("stuck", "limits", None)
    assert result.alternatives


def fruitless(count: int) -> list[Experience]:
    """Actions that move nothing."""
    done = MoveAction(edge=3, dx_m=0.05, dy_m=0.05, dtheta_rad=0.0)
    return [Experience(before=line(), action=done, after=line()) for _ in range(count)]


def test_stuck_where_the_last_actions_brought_nothing(tools):
    """Ten actions in a row left an S-shape at 24 mm, each with the promise of less."""
    assert run(tools, history=fruitless(3), tried=3).status.code == "ok"
    assert run(tools, history=fruitless(4), tried=3).status.code == "ok"
    result = run(tools, history=fruitless(4), tried=4)
    assert (result.status.code, result.status.reason, result.action) == (
        "stuck",
        "unlike_any_model",
        None,
    )
    assert "unlike_any_model" in codes(result)
    assert result.alternatives


def dry(stiffness_m: float, count: int = 4) -> list[Experience]:
    """What a DLO on a table with dry friction does."""
    rng, state, items = np.random.default_rng(3), straight(np.array([LENGTH]), 16), []
    for _ in range(count):
        act = Actions.random(rng, 1, 16)
        (dx, dy), turn = act.shift[0], act.turn[0]
        after = slide(
            state,
            act.edge,
            np.array([[dx, dy, turn]]),
            Sliders.straight(np.array([stiffness_m]), 16),
        )
        done = MoveAction(edge=int(act.edge[0]), dx_m=dx, dy_m=dy, dtheta_rad=turn)
        items.append(Experience(before=state[0].tolist(), action=done, after=after[0].tolist()))
        state = after
    return items


def test_a_shape_that_friction_does_not_hold(tools):
    """Stiff ropes crept back from every S-shape, and no answer gave that as the reason."""
    stiff = run(tools, history=dry(3.0), target_m=target_shape("S", LENGTH))
    assert stiff.parameters.friction == "dry"
    assert stiff.parameters.stiffness_m == pytest.approx(3.0, rel=0.5)
    assert "springs_back" in codes(stiff)
    limp = run(tools, history=dry(0.05), target_m=target_shape("S", LENGTH))
    assert limp.parameters.friction == "dry"
    assert codes(limp) == set()


def test_actions_state_how_likely_they_are_to_help(tools):
    known = run(tools, history=experience(k_b=0.1, k_d=20.0))
    unknown = run(tools, history=fruitless(3))
    assert known.action.probability > 0.8
    assert unknown.action.probability < 0.7


def test_history_is_learnt_from(tools):
    result = run(tools, history=experience(k_b=0.1, k_d=20.0))
    assert result.parameters.source == "history"
    assert result.parameters.k_b / result.parameters.k_d == pytest.approx(0.005, rel=0.2)
    assert result.warnings == []


def test_history_that_contradicts_itself_is_said(tools):
    items = experience()
    wrong = items[2].model_copy(update={"after": [(x + 0.2, y) for x, y in items[2].after]})
    result = run(tools, history=[*items[:2], wrong, items[3]])
    assert [w.field for w in result.warnings if w.code == "history_contradicts"] == ["history.2"]


def test_estimates_come_with_what_is_left(tools):
    result = stages.run(
        EstimateParametersRequest(history=experience(0.3, 10.0), object=OBJECT), tools
    ).result
    assert result.k_b / result.k_d == pytest.approx(0.03, rel=0.15)
    assert result.loss_m < result.loss_mid_range_m
    assert len(result.sample_errors_m) == 4
    assert result.ratio_sigma <= max(result.sigma)


@pytest.mark.parametrize("stiffness", [0.05, 1.0])
def test_estimates_tell_dry_friction_and_the_stiffness_over_it(tools, stiffness):
    result = stages.run(
        EstimateParametersRequest(history=dry(stiffness), object=OBJECT), tools
    ).result
    assert result.friction == "dry"
    assert result.stiffness_m == pytest.approx(stiffness, rel=0.5)
    viscous = stages.run(
        EstimateParametersRequest(history=experience(0.3, 10.0), object=OBJECT), tools
    ).result
    assert (viscous.friction, viscous.stiffness_m) == ("viscous", None)


def test_an_edge_that_is_not_there(tools):
    item = experience(count=1)[0]
    beyond = item.model_copy(update={"action": item.action.model_copy(update={"edge": 15})})
    for bad in (
        request(history=[beyond]),
        EstimateParametersRequest(history=[beyond], object=OBJECT),
    ):
        with pytest.raises(InvalidInput) as caught:
            stages.run(bad, tools)
        assert caught.value.field == "history.0.action.edge"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"state_m": [(0, 0)]}, "at least 2"),
        ({"state_m": [(0, 0), (float("nan"), 0)]}, "finite|greater|less|nan"),
        ({"state_m": [(0.1, 0.1)] * 5}, "one place"),
        ({"state_m": None}, "state_m"),
        ({"state_m": line(2001)}, "at most 2000"),
        ({"object": {"mass_kg": 0}}, "greater than 0"),
        ({"horizon": 9}, "less than or equal to 4"),
        ({"limits": {"reach_m": (0.1, 0.5)}}, "belong together"),
        ({"limits": {"workspace_m": ((1, 1), (0, 0))}}, "lower"),
        ({"model": "foreground_compact"}, "no meaning"),
        ({"homography": ((1, 0, 0), (0, 1, 0), (0, 0, 1))}, "exclude"),
    ],
)
def test_bad_requests_name_their_field(fields, said):
    with pytest.raises(ValidationError, match=said):
        request(**fields)


def scaled(points, factor: float) -> list[tuple[float, float]]:
    return [(factor * x, factor * y) for x, y in points]


@pytest.mark.parametrize(
    ("fields", "unit"),
    [
        ({"state_m": scaled(line(), 1000), "target_m": scaled(U, 1000)}, "millimeters"),
        ({"state_m": scaled(line(), 100), "target_m": scaled(U, 100)}, "centimeters"),
        ({"target_m": scaled(U, 30)}, "in another unit"),
        ({"object": DloObject(mass_kg=0.05, length_m=15.0)}, "in another unit"),
        ({"object": {"mass_kg": 0.05, "length_m": 1e-300}}, "length_m"),
        (
            {
                "history": [
                    {
                        "before": line(),
                        "after": scaled(line(), 10),
                        "action": {"edge": 3, "dx_m": 0.05, "dy_m": 0.0, "dtheta_rad": 0.0},
                    }
                ]
            },
            "`after` is",
        ),
    ],
)
def test_lengths_that_no_dlo_has_are_refused_with_the_likely_unit(fields, unit):
    """A plan in millimeters moved the gripper by 80 m."""
    with pytest.raises(ValidationError, match=unit):
        request(**fields)


def test_a_long_dlo_is_moved_no_farther_than_is_stated(tools):
    """The trained 0.1 m grew with the DLO's length, to 0.4 m here, though the limit is stated as
    0.1."""
    far = [(x, y + 1.0) for x, y in line(16, 2.0)]
    for wish, most in ((None, 0.1), (0.3, 0.3)):
        limits = {} if wish is None else {"max_displacement_m": wish}
        result = run(tools, state_m=line(16, 2.0), target_m=far, limits=limits)
        moves = [result.action, *result.alternatives]
        assert max(max(abs(a.dx_m), abs(a.dy_m)) for a in moves) == pytest.approx(most, abs=1e-4)
