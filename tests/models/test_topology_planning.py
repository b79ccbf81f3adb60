"""The disentangling planner on harnesses drawn by hand, and on random ones in a simulated world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.topology.bodies import Pivot, body_of, turned
from models.topology.disentangling import Base, DisentangleParams, _room, _steady, assign_arms, plan
from models.topology.drawing import draw_action, overlay
from models.topology.scene import Crossing, Place
from tests.benchmarks.harness_world import execute, one_crossing, truth
from tests.models.harnesses import crossed, section, topology


def test_the_branch_is_turned_away_about_its_branch_point():
    """Thesis 6.7: the upper section, about the branch-point it hangs on."""
    action = plan(crossed())[0]
    assert (action.before, action.after) == (1, 0)
    assert action.section == 2
    assert action.branch == 0
    assert action.hold.xy == pytest.approx((200, 240))
    assert action.turn > 0, "down, away from the trunk: from x towards y"


def test_the_arc_keeps_its_distance_to_the_held_place_and_ends_at_the_place():
    action = plan(crossed())[0]
    away = np.hypot(*(action.trajectory - np.array(action.hold.xy)).T)
    assert away.max() - away.min() < 1e-6
    assert tuple(action.trajectory[0]) == pytest.approx(action.pick.xy)
    assert tuple(action.trajectory[-1]) == pytest.approx(action.place.xy)
    turned_by = np.arctan2(
        np.sin(action.place.angle - action.pick.angle), np.cos(action.place.angle - action.pick.angle)
    )
    assert turned_by == pytest.approx(action.turn, abs=1e-6)


def test_a_turn_still_helps_if_the_arms_turn_a_step_more_or_less():
    assert _steady(np.array([1, 0, 0, 0, 1, 0, 0]), 5).tolist() == [1, 1, 0, 1, 1, 0, 0]


def test_a_hand_needs_room_beside_a_strand():
    near = topology([section([(0, 100), (300, 100)], width=8), section([(0, 110), (150, 110)], width=8)])
    room = _room(near, 0, np.array([50.0, 280.0]))
    assert room[0] == pytest.approx((10 - 4) / (4 + 12), abs=0.02)
    assert room[1] == 1


def test_a_piece_that_lies_under_is_left_alone():
    harness = crossed()
    below = harness.crossings[0]
    harness = replace(harness, crossings=(replace(below, over=below.under, under=below.over),))
    assert all(a.section != 2 for a in plan(harness))


def test_an_unknown_order_halves_the_certainty():
    assert plan(crossed(0.5))[0].certainty == 0.5
    assert plan(crossed(0.5))[0].score < 0.6 * plan(crossed(1.0))[0].score


def test_without_crossings_or_sections_there_is_nothing_to_do():
    assert plan(topology([section([(10, 10), (200, 10)])])) == []
    assert plan(topology([])) == []


def test_a_section_held_at_both_ends_does_not_turn():
    """A cycle: both ways round lead back to the place held."""
    upper = section([(200, 240), (300, 140), (400, 240)], (0, 1))
    lower = section([(200, 240), (400, 240)], (0, 1))
    left, right = section([(60, 240), (200, 240)], (-1, 0)), section([(400, 240), (560, 240)], (1, -1))
    harness = topology([left, upper, lower, right], [(200, 240), (400, 240)])
    assert body_of(harness, Pivot(1, 0.0, 1, 0)) is None
    assert body_of(harness, Pivot(0, 140.0, -1, 0)) is not None


def test_two_plain_cables_are_parted_about_a_place_along_one():
    over, under = section([(100, 100), (500, 380)]), section([(100, 380), (500, 100)])
    crossing = Crossing((300, 240), Place(0, 0.5), Place(1, 0.5), 1.0, 1.0)
    action = plan(topology([over, under], crossings=[crossing]))[0]
    assert action.section == 0
    assert action.branch == -1
    assert action.after == 0


def test_the_nearer_arms_are_chosen_and_reach_is_kept():
    action = plan(crossed())[0]
    near_hold, near_pick = Base((100, 240)), Base((500, 300))
    assert assign_arms(action, [near_hold, near_pick]) == (0, 1)
    assert assign_arms(action, [near_pick, near_hold]) == (1, 0)
    assert assign_arms(action, [replace(near_hold, reach=10.0), replace(near_pick, reach=10.0)]) is None


def test_fewer_actions_than_asked_for_are_no_fault_and_no_more_are_given():
    assert len(plan(crossed(0.5), DisentangleParams(at_most=1))) == 1


def test_turning_by_a_quarter_takes_x_to_y():
    assert turned(np.array([[3.0, 1.0]]), np.array([1.0, 1.0]), np.pi / 2) == pytest.approx(np.array([[1.0, 3.0]]))


def test_most_single_crossings_are_undone_in_a_world_with_errors():
    undone = 0
    for k in range(12):
        rng = np.random.default_rng([21, k])
        harness = one_crossing(rng, 1)
        actions = plan(truth(harness))
        if actions:
            outcome = execute(harness, actions[0], rng)
            undone += outcome.moved and not outcome.harness.crossings
    assert undone >= 11


def test_the_picture_shows_the_action():
    harness = crossed()
    ground = np.zeros((*harness.size, 3), np.uint8)
    plain = overlay(ground, harness)
    shown = draw_action(plain, plan(harness)[0])
    assert shown.shape == plain.shape
    assert (shown != plain).any()
    assert (plain != ground).any()
    assert not ground.any()
