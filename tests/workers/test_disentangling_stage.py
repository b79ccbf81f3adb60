"""``plan_disentangle`` on real bytes and the shipped networks, and every bad input of its own."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from dlo_client.contracts import (
    ArmBase,
    DisentangleRequest,
    DisentangleResult,
    Earlier,
    Gripper,
    HarnessState,
    TopologyRequest,
    TopologyResult,
)
from pydantic import ValidationError

from models.disentangling.plan import plan
from tests.models.harnesses import crossed
from tests.workers.harness_pictures import depth_of, harness_mask, put
from workers import stages
from workers.stages import plan_disentangle
from workers.stages.outcome import InvalidInput, Tools


def topology_of(tools: Tools) -> TopologyResult:
    return stages.run(TopologyRequest(mask=put(tools, harness_mask())), tools).result


def test_a_plan_from_a_mask_and_from_its_topology_agree(tools):
    mask, depth = put(tools, harness_mask()), put(tools, depth_of(True))
    arms = [ArmBase(name="left", xy=(0, 400)), ArmBase(name="right", xy=(500, 300))]
    planned = stages.run(DisentangleRequest(mask=mask, depth=depth, arms=arms), tools)
    result = planned.result
    assert isinstance(result, DisentangleResult)
    assert result.status == "planned"
    assert set(planned.files) == {"overlay.png"}
    best = result.actions[0]
    assert (best.rank, best.crossings_before, best.crossings_after) == (1, 1, 0)
    assert best.hold.arm == "left"
    assert best.pick.arm == best.place.arm == "right"
    assert best.trajectory_xy[0] == best.pick.xy
    assert best.trajectory_xy[-1] == best.place.xy
    assert "leaves 0 of 1" in best.why
    assert result.topology is not None
    given = json.loads(result.topology.model_dump_json())
    again = stages.run(
        DisentangleRequest(topology=HarnessState.model_validate(given), arms=arms), tools
    ).result
    assert again.actions[0].section == best.section
    assert again.actions[0].turn_rad == pytest.approx(best.turn_rad, abs=0.1)
    assert again.topology is None


def test_an_action_that_more_likely_fails_is_called_unsure_first(tools, monkeypatch):
    """A best score of 0.08 was answered as "planned"."""
    request = DisentangleRequest(mask=put(tools, harness_mask()), gripper=Gripper(width_px=12))
    sure = stages.run(request, tools).result
    assert sure.actions[0].score >= plan_disentangle.UNSURE_BELOW
    monkeypatch.setattr(plan_disentangle, "UNSURE_BELOW", 1.01)
    unsure = stages.run(request, tools).result
    assert unsure.status == "unsure"
    assert unsure.message.startswith(
        f"unsure: the best action works with probability {sure.actions[0].score:.2f} only"
    )
    assert unsure.actions == sure.actions, "they are still proposed"


@pytest.mark.slow
def test_the_grippers_size_is_taken_in_pixels_or_in_meters(tools):
    mask = put(tools, harness_mask())
    given = [Gripper(width_px=12), Gripper(width_m=0.006, m_per_px=0.0005), Gripper(width_px=90)]
    pixels, meters, huge = (
        stages.run(DisentangleRequest(mask=mask, gripper=g), tools).result.actions for g in given
    )
    assert pixels == meters
    assert pixels != huge


@pytest.mark.parametrize(
    ("gripper", "message"),
    [
        ({}, "either `width_px` or `width_m`"),
        ({"width_px": 3, "width_m": 0.1, "m_per_px": 0.1}, "either"),
        ({"width_m": 0.1}, "belong together"),
        ({"width_px": 3, "m_per_px": 0.1}, "belong together"),
        ({"width_px": 0}, "width_px"),
        ({"width_px": 1e-300}, "width_px"),
        ({"width_px": float("nan")}, "width_px"),
    ],
)
def test_a_gripper_without_a_size_is_refused(gripper, message):
    with pytest.raises(ValidationError, match=message):
        DisentangleRequest.model_validate({"gripper": gripper})


def test_without_crossing_there_is_a_reason(tools):
    mask = np.zeros((200, 300), np.uint8)
    cv2.line(mask, (20, 100), (280, 100), 255, 9)
    result = stages.run(DisentangleRequest(mask=put(tools, mask)), tools).result
    assert (result.status, result.actions) == ("no_crossing", [])
    assert "no crossing" in result.message


def test_out_of_reach_is_a_reason(tools):
    arms = [ArmBase(name=n, xy=(5000, 5000), reach_px=10) for n in ("a", "b")]
    result = stages.run(
        DisentangleRequest(mask=put(tools, harness_mask()), arms=arms), tools
    ).result
    assert (result.status, result.actions) == ("no_action", [])
    assert "reach" in result.message


def test_an_action_within_reach_is_found_behind_better_ones_that_are_not(tools):
    """Only the ``at_most`` best ones were looked at, and the answer said that none is in reach."""
    mask = put(tools, harness_mask())
    anywhere = stages.run(DisentangleRequest(mask=mask, at_most=50), tools).result.actions
    wanted = next(a for a in anywhere if np.hypot(*np.subtract(a.hold.xy, anywhere[0].hold.xy)) > 5)
    far = np.hypot(*np.subtract(wanted.pick.xy, wanted.hold.xy)) + 1
    arms = [
        ArmBase(name=name, xy=wanted.hold.xy, reach_px=reach)
        for name, reach in (("holds", 1), ("turns", far))
    ]
    result = stages.run(DisentangleRequest(mask=mask, arms=arms, at_most=1), tools).result
    assert result.status in ("planned", "unsure")
    assert result.actions[0].hold.xy == wanted.hold.xy
    assert result.actions[0].hold.arm == "holds"


def test_arms_reach_in_pixels_or_in_meters(tools):
    mask = put(tools, harness_mask())

    def planned(**reach):
        arms = [
            ArmBase(name="left", xy=(0, 400), **reach),
            ArmBase(name="right", xy=(500, 300), **reach),
        ]
        return stages.run(DisentangleRequest(mask=mask, arms=arms), tools).result.actions

    in_pixels = planned(reach_px=400)
    assert in_pixels
    assert planned(reach_m=0.2, m_per_px=0.0005) == in_pixels
    assert planned(reach_m=0.2, m_per_px=0.05) == []


def test_expectations_follow_what_was_tried(tools):
    """After every failure the same action came with the same probability."""
    mask = put(tools, harness_mask())
    best = stages.run(DisentangleRequest(mask=mask), tools).result.actions[0]

    def after(crossings: int) -> float:
        done = [{"action": best.model_dump(), "crossings": crossings}] * 2
        request = DisentangleRequest.model_validate({"mask": mask.model_dump(), "attempts": done})
        actions = stages.run(request, tools).result.actions
        return next(
            (a.score for a in actions if a.section == best.section and a.hold.xy == best.hold.xy),
            0.0,
        )

    assert after(best.crossings_after + 1) < 0.7 * best.score
    assert after(best.crossings_after) >= best.score


def earlier(tools: Tools) -> dict[str, object]:
    """What stands in a request of the action that the mask's own plan begins with, not done yet."""
    planned = stages.run(DisentangleRequest(mask=put(tools, harness_mask())), tools).result
    action = planned.actions[0].model_copy(update={"turn_rad": 0.0})
    return {"topology": planned.topology, "action": action}


def test_an_earlier_topology_that_the_picture_agrees_with_is_carried_over(tools):
    """Read as surely as it was in the earlier picture, and named as there."""
    known = earlier(tools)
    crossing = known["topology"].crossings[0].model_copy(update={"order_score": 0.97})
    known["topology"] = known["topology"].model_copy(update={"crossings": [crossing]})
    request = DisentangleRequest.model_validate(
        {"mask": put(tools, harness_mask()), "earlier": known}
    )
    result = stages.run(request, tools).result
    assert result.carried
    assert result.topology.crossings[0].order_score == 0.97
    again = Earlier.model_validate({"topology": result.topology, "action": result.actions[0]})
    assert again.topology.width == 400, "an answer fits into the next request"


def test_an_action_outside_the_picture_says_so():
    """Known from an earlier picture only, and planned there without a word."""
    action = plan(crossed(), lambda rows: np.full(len(rows), 0.9))[0]
    x, y = action.pick.xy
    said = [plan_disentangle._why(action, size) for size in ((480, 640), (480, round(x) - 5))]
    assert ["outside the picture" in why for why in said] == [False, True]
    assert 0 < y < 480


def test_a_picture_that_shows_something_else_is_planned_on_alone(tools):
    mask = put(tools, np.ascontiguousarray(harness_mask()[:, ::-1]))
    request = DisentangleRequest.model_validate({"mask": mask, "earlier": earlier(tools)})
    assert not stages.run(request, tools).result.carried


def test_where_nothing_helps_by_what_was_known_the_picture_is_planned_on(tools):
    """A reading that has no crossing any more was kept, though the picture shows one."""
    known = earlier(tools)
    known["topology"] = known["topology"].model_copy(update={"crossings": []})
    request = DisentangleRequest.model_validate(
        {"mask": put(tools, harness_mask()), "earlier": known}
    )
    result = stages.run(request, tools).result
    assert result.status in ("planned", "unsure")
    assert not result.carried


def test_an_earlier_picture_of_another_size_is_refused(tools):
    mask = put(tools, harness_mask()[:200])
    request = DisentangleRequest.model_validate({"mask": mask, "earlier": earlier(tools)})
    with pytest.raises(InvalidInput, match="400 × 280") as error:
        stages.run(request, tools)
    assert error.value.field == "earlier.topology"


def test_an_earlier_topology_needs_a_new_picture(tools):
    state = topology_of(tools).model_dump(mode="json")
    known = earlier(tools)
    with pytest.raises(ValidationError, match="`earlier` is compared with a new picture"):
        DisentangleRequest.model_validate({"topology": state, "earlier": known})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arms": [{"name": "a", "xy": [0, 0]}]}, "`arms` needs two"),
        ({"arms": [{"name": "a", "xy": [0, 0]}, {"name": "a", "xy": [1, 1]}]}, "same name"),
        ({"mask": {"id": "a" * 64}}, "`topology` already says"),
        (
            {"arms": [{"name": "a", "xy": [0, 0], "reach_m": 1}]},
            "`reach_m` and `m_per_px` belong together",
        ),
        (
            {"arms": [{"name": "a", "xy": [0, 0], "reach_px": 1, "reach_m": 1, "m_per_px": 0.1}]},
            "exclude each other",
        ),
    ],
)
def test_requests_that_cannot_be_are_refused(tools, change, message):
    state = topology_of(tools).model_dump(mode="json")
    with pytest.raises(ValidationError, match=message):
        DisentangleRequest.model_validate({"topology": state} | change)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("crossings", 0, "over", "section"), 9, "crossings.*not there"),
        (("branch_points", 0, "sections"), [7], "branch_points.*not there"),
        (("sections", 0, "branch_points"), [5, None], "branch-point that is not there"),
        (("sections", 0, "id"), 4, "ids count"),
        (("sections", 0, "points_xy"), [[1, 1]], "2 to 5000"),
    ],
)
def test_a_topology_that_does_not_fit_together_is_refused(tools, place, value, message):
    state = topology_of(tools).model_dump(mode="json")
    here = state
    for step in place[:-1]:
        here = here[step]
    here[place[-1]] = value
    with pytest.raises(ValidationError, match=rf"(?s){message}"):
        HarnessState.model_validate(state)


def test_a_section_without_length_is_refused(tools):
    state = topology_of(tools).model_dump(mode="json")
    state["sections"][0]["points_xy"] = [[5, 5], [5, 5]]
    with pytest.raises(InvalidInput, match="no length"):
        stages.run(DisentangleRequest(topology=HarnessState.model_validate(state)), tools)


def test_a_request_by_topology_needs_no_picture_and_one_by_picture_does(tools):
    state = topology_of(tools).model_dump(mode="json")
    assert not DisentangleRequest(topology=HarnessState.model_validate(state)).needs_picture
    assert DisentangleRequest().needs_picture
    with pytest.raises(InvalidInput, match="an image or a mask"):
        stages.run(DisentangleRequest(), tools)
