"""``plan_shape`` with pegs, clips, edges and routes through the stage: answers, and every kind of
impossible input."""

from __future__ import annotations

import numpy as np
import pytest
from dlo_client.contracts import PlanShapeRequest, PlanShapeResult
from pydantic import ValidationError

from workers import stages
from workers.stages.outcome import InvalidInput, Tools

LINE = [[0.02 * k, 0.0] for k in range(21)]
PEG = {"kind": "peg", "xy_m": [0.2, -0.03], "radius_m": 0.01}
CLIP = {"kind": "clip", "xy_m": [0.3, 0.02], "angle_rad": 0.2, "width_m": 0.015, "length_m": 0.02}
WALL = {"kind": "edge", "from_m": [0.1, 0.05], "to_m": [0.2, 0.05]}
ACROSS = WALL | {"from_m": [0.25, -0.02], "to_m": [0.25, 0.04]}
BESIDE = WALL | {"from_m": [0.24, -0.06], "to_m": [0.24, -0.008]}
ROUTE = {"stops": [{"fixture": 0, "side": "left"}, {"fixture": 1}]}
ASKED = {
    "state_m": LINE,
    "object": {"mass_kg": 0.05},
    "fixtures": [PEG, CLIP, WALL],
    "route": ROUTE,
}


def run(tools: Tools, **fields) -> PlanShapeResult:
    return stages.run(PlanShapeRequest.model_validate(ASKED | fields), tools).result


def test_an_action_towards_a_route(tools):
    found = run(tools)
    assert found.status.code == "ok"
    assert found.stops_left == [0, 1]
    assert found.error_after_m < found.error_before_m
    assert found.action.probability is None
    assert {c.name for c in found.action.checks} == {"displacement", "rotation", "fixtures"}
    assert len(found.target_m) == 31
    assert run(tools) == found


def test_the_shape_of_the_answer_is_on_the_route(tools):
    done = run(tools, state_m=run(tools).target_m)
    assert done.status.code == "done"
    assert done.converged
    assert done.stops_left == []


def test_scale_changes_nothing(tools):
    """A DLO of 2 m with fixtures five times as large and as far is planned as one of 0.4 m."""

    def larger(value):
        return [larger(v) for v in value] if isinstance(value, list) else 5 * value

    names = ("xy_m", "radius_m", "width_m", "length_m", "from_m", "to_m")
    fixtures = [
        {k: larger(v) if k in names else v for k, v in f.items()} for f in ASKED["fixtures"]
    ]
    small = run(tools, object={"mass_kg": 0.05, "diameter_m": 0.005})
    big = run(
        tools,
        state_m=larger(LINE),
        fixtures=fixtures,
        route=ROUTE | {"slack_m": 0.1},
        object={"mass_kg": 0.05, "diameter_m": 0.025},
    )
    assert big.action.edge == small.action.edge
    assert np.allclose(big.target_m, 5 * np.array(small.target_m), atol=0.01)


def test_a_target_beside_a_peg_without_a_route(tools):
    target = [[x, 0.05 * np.sin(6 * x)] for x, _ in LINE]
    found = run(tools, route=None, target_m=target, fixtures=[PEG])
    assert found.status.code == "ok"
    assert found.stops_left == []


def test_keep_out_is_kept_among_fixtures_with_the_grippers_room(tools):
    area = [[0.0, 0.02], [0.4, 0.02], [0.4, 0.2], [0.0, 0.2]]
    route = {"stops": [{"fixture": 0, "side": "left"}]}
    free = run(tools, route=route, fixtures=[PEG])
    kept = run(
        tools, route=route, fixtures=[PEG], limits={"keep_out_m": [area]}, gripper={"width_m": 0.02}
    )
    assert free.status.code == "ok"
    if kept.action is not None:
        ys = [
            kept.action.pick.xy_m[1],
            kept.action.place.xy_m[1],
            *(y for _, y in kept.predicted_m),
        ]
        assert max(ys) < 0.02


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"fixtures": [PEG, PEG | {"xy_m": [0.21, -0.03]}]}, "fixtures.1"),
        (
            {
                "fixtures": [CLIP, PEG | {"xy_m": [0.3, 0.025]}],
                "route": {"stops": [{"fixture": 0}]},
            },
            "fixtures.1",
        ),
        ({"object": {"mass_kg": 0.05, "diameter_m": 0.02}}, "fixtures.1.width_m"),
        ({"route": {"stops": [{"fixture": 7, "side": "left"}]}}, "route.stops.0.fixture"),
        ({"route": {"stops": [{"fixture": 2}]}}, "route.stops.0.fixture"),
        ({"route": {"stops": [{"fixture": 0}]}}, "route.stops.0.side"),
        ({"route": {"stops": [{"fixture": 1, "side": "left"}]}}, "route.stops.0.side"),
        ({"route": {"stops": [{"fixture": 1}, {"fixture": 1}]}}, "route.stops.1.fixture"),
        ({"limits": {"base_xy_m": [0, 0], "reach_m": [0.0, 0.25]}}, "fixtures.1"),
        ({"limits": {"workspace_m": [[0, -0.2], [0.25, 0.2]]}}, "fixtures.1"),
        ({"target_m": LINE}, "target_m"),
        ({"route": None}, "target_m"),
        ({"scale_target": True}, "scale_target"),
        ({"state_m": None, "homography": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "route.start_m"),
    ],
)
def test_impossible_requests_name_the_field(fields, name):
    with pytest.raises(ValidationError) as error:
        PlanShapeRequest.model_validate(ASKED | fields)
    assert f"`{name}`" in str(error.value)


@pytest.mark.parametrize(
    ("fields", "field", "text"),
    [
        ({"route": ROUTE | {"end_m": [0.6, 0.0]}}, "route", "m long, the DLO 0.400 m"),
        ({"fixtures": [PEG | {"xy_m": [0.2, 0.0]}, CLIP]}, "state_m", "fixtures.0"),
        ({"fixtures": [PEG, CLIP | {"width_m": 0.003}]}, "fixtures.1.width_m", "0.004 m thick"),
        ({"fixtures": [PEG, CLIP, ACROSS]}, "state_m", "fixtures.2"),
        (
            {"fixtures": [PEG, CLIP, BESIDE], "state_m": [[x, y + 0.01] for x, y in LINE]},
            "route",
            "fixtures.2",
        ),
        ({"route": None, "target_m": [[x, -0.03] for x, _ in LINE]}, "target_m", "fixtures.0"),
    ],
)
def test_what_only_the_state_shows_to_be_impossible(tools, fields, field, text):
    with pytest.raises(InvalidInput) as error:
        run(tools, **fields)
    assert error.value.field == field
    assert text in str(error.value)
