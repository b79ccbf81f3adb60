"""Pegs, clips and edges: routes, ways around pegs with numeric answers, contact, and plans that end
on a route."""

from __future__ import annotations

import numpy as np
import pytest

from models.manipulation import routing
from models.manipulation.contact import add_rows, pushes
from models.manipulation.detours import detours, string_ways
from models.manipulation.fixtures import Clip, Fixtures, in_clip, segment_distance
from models.manipulation.limits import Limits, carried_into
from models.manipulation.routes import Impossible, Route, Stop
from models.manipulation.routing import (
    FINE,
    Goal,
    World,
    _foreseen,
    _proposed,
    _reachable,
    likely_stiffness,
    routed,
)

PEG = np.array([0.2, 0.0])


def pegs(*places: tuple[float, float], radius: float = 0.02) -> Fixtures:
    at = np.array(places)
    return Fixtures(at, at, np.full(len(at), radius))


def straight(y: float, length: float = 0.4, nodes: int = FINE, x: float = 0.0) -> np.ndarray:
    return np.column_stack([np.linspace(x, x + length, nodes), np.full(nodes, y)])


def test_distances_of_segments():
    a, b = np.array([[0.0, 0.0], [0.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    c, d = np.array([[0.5, -1.0], [3.0, 4.0]]), np.array([[0.5, 1.0], [3.0, 4.0]])
    assert np.allclose(segment_distance(a, b, c, d), [[0.0, np.hypot(2, 4)], [0.5, 5.0]])


@pytest.mark.parametrize(("side", "sign"), [(1, -1), (-1, 1)])
def test_a_route_touches_its_peg_on_the_side_that_is_asked_for(side, sign):
    route = Route([Stop(PEG, 0.02, side)], 0.03, np.zeros(2), end=np.array([0.4, 0.0]))
    shape = route.shape(0.5, 51)
    assert np.allclose(shape[0], 0)
    assert np.isclose(np.hypot(*np.diff(shape, axis=0).T).sum(), 0.5, atol=2e-3)
    nearest = shape[np.argmin(np.hypot(*(shape - PEG).T))]
    assert np.isclose(nearest[1], sign * 0.03, atol=2e-3)
    assert route.missed(shape) == []
    assert route.missed(shape * [1, -1]) == [0]


def test_a_route_around_two_pegs_bends_both_ways():
    stops = [Stop(np.array([0.1, 0.0]), 0.02, 1), Stop(np.array([0.25, 0.0]), 0.02, -1)]
    shape = Route(stops, 0.03, np.array([0.0, 0.0])).shape(0.4, 81)
    assert shape[:, 1].min() < -0.02
    assert shape[:, 1].max() > 0.02
    assert (
        Fixtures(np.array([s.xy for s in stops]), np.array([s.xy for s in stops]), np.full(2, 0.02))
        .gap(shape[:-1], shape[1:])
        .min()
        > 0.005
    )


def test_the_order_of_stops_counts():
    stops = [Stop(np.array([0.1, 0.02]), 0.01, 1), Stop(np.array([0.3, 0.02]), 0.01, 1)]
    line = straight(0.0)
    assert Route(stops, 0.03, line[0]).missed(line) == []
    assert Route(stops[::-1], 0.03, line[0]).missed(line) == [1]


def test_too_much_room_at_a_peg_is_missed():
    assert Route([Stop(PEG, 0.02, 1)], 0.03, np.zeros(2)).missed(straight(-0.04)) == []
    assert Route([Stop(PEG, 0.02, 1)], 0.03, np.zeros(2)).missed(straight(-0.06)) == [0]


def test_a_route_that_is_longer_than_the_dlo():
    with pytest.raises(Impossible, match=r"is 0\.198 m long, the DLO 0\.150 m"):
        Route([Stop(PEG, 0.02, 1)], 0.03, np.zeros(2)).shape(0.15, FINE)


def test_pegs_with_no_room_between_them():
    stops = [Stop(PEG, 0.02, 1), Stop(PEG + np.array([0.03, 0.0]), 0.02, -1)]
    with pytest.raises(Impossible) as found:
        Route(stops, 0.03, np.zeros(2)).shape(0.5, FINE)
    assert found.value.stop == 1


@pytest.mark.parametrize(
    ("y", "turn", "inside"),
    [(0.0, 0.0, True), (0.004, 0.0, True), (0.008, 0.0, False), (0.0, 0.8, False)],
)
def test_a_clip_holds_what_is_between_its_walls_and_along_it(y, turn, inside):
    clip = Clip(PEG + np.array([0.0, y]), turn, 0.005)
    place = in_clip(clip, straight(0.0))
    assert (place is not None) == inside
    if place is not None:
        assert np.isclose(place, 15.0)


def test_the_way_around_a_peg_is_that_of_a_pulled_string():
    """A DLO above a peg that should be below it: its end comes back, around the peg, to its
    place."""
    fixtures = pegs((0.2, 0.0), radius=0.001)
    above, below = straight(0.05, 0.3), straight(-0.05, 0.3)
    ways = detours(above[None], below, fixtures)[0]
    assert np.allclose(ways[:20], 0.1, atol=1e-6)  # not beyond the peg: straight down
    # The last point: back to the peg, across on its left, and out again; a string at the peg itself
    # is shorter.
    assert np.isclose(ways[-1], 0.3, atol=0.011)
    assert ways[-1] > 2 * np.hypot(0.1, 0.05)
    way = string_ways(above, below, fixtures, [FINE - 1])[0]
    assert len(way) > 2
    assert way[1:-1, 0].min() < 0.2


def test_without_fixtures_the_way_is_the_distance():
    a, b = straight(0.05), straight(-0.05)
    assert np.allclose(detours(a[None], b, Fixtures()), 0.1)


def test_what_is_inside_a_peg_is_pushed_out():
    found = pushes(straight(0.01)[None], pegs((0.2, 0.0)), np.zeros((1, 0), bool))
    assert np.allclose(found.direction, [0, 1], atol=0.8)
    assert np.isclose(found.depth.max(), 0.01)
    nothing = pushes(straight(0.03)[None], pegs((0.2, 0.0)), np.zeros((1, 0), bool))
    assert len(nothing.depth) == 0


def test_rows_of_contact_are_the_gradient_of_its_energy():
    """Against differences: the depth's derivatives by the first node and by all headings."""
    rng = np.random.default_rng(5)
    fixtures, heading = pegs((0.02, 0.004), radius=0.02), rng.normal(0, 0.3, 5)

    def nodes(q):
        steps = 0.01 * np.column_stack([np.cos(q[2:]), np.sin(q[2:])])
        return np.vstack([q[:2], q[:2] + np.cumsum(steps, 0)])

    def energy(q: np.ndarray) -> float:
        return 1e5 * float(
            (pushes(nodes(q)[None], fixtures, np.zeros((1, 0), bool)).depth ** 2).sum()
        )

    q = np.concatenate([[0.0, 0.001], heading])
    right, system = np.zeros((1, 7)), np.zeros((1, 7, 7))
    normal = 0.01 * np.column_stack([-np.sin(heading), np.cos(heading)])[None]
    add_rows(pushes(nodes(q)[None], fixtures, np.zeros((1, 0), bool)), normal, right, system)
    numeric = [(energy(q + h) - energy(q - h)) / 2e-7 for h in 1e-7 * np.eye(7)]
    assert np.allclose(-right[0], numeric, rtol=1e-3, atol=1e-3)


def test_a_peg_stops_a_dlo_that_is_dragged_against_it():
    world = World(pegs((0.2, 0.03), radius=0.015), Limits())
    action = np.array([10]), np.array([[0.0, 0.06, 0.0]])
    through = World(Fixtures(), Limits()).ways(straight(0.0)[None], *action)[0, -1]
    around = world.ways(straight(0.0)[None], *action)[0, -1]
    gaps = [world.fixtures.gap(shape[:-1], shape[1:]).min() for shape in (through, around)]
    assert gaps[0] < -0.003
    assert gaps[1] > -0.0015


def test_no_action_pulls_a_dlo_through_an_edge():
    """A target beyond a wall: half a step of the gripper was enough to be on its other side."""
    wall = Fixtures(np.array([[0.1, 0.02]]), np.array([[0.3, 0.02]]), np.array([0.004]))
    found = routed(World(wall, Limits()), straight(0.0), Goal(straight(0.06)), most=40)
    assert len(found.edge)
    for shape in found.predicted:
        assert wall.gap(shape[:-1], shape[1:]).min() > -0.003
        assert not (shape[(shape[:, 0] > 0.18) & (shape[:, 0] < 0.22), 1] > 0.02).any()


def test_a_clip_holds_a_dlo_that_is_pulled_sideways():
    clip = Clip(PEG, 0.0, 0.003)
    action = np.array([18]), np.array([[0.0, 0.05, 0.0]])
    held, free = (
        World(Fixtures(clips=clips), Limits()).ways(straight(0.0)[None], *action)[0, -1]
        for clips in ([clip], [])
    )
    assert in_clip(clip, held) is not None
    assert in_clip(clip, free) is None


def test_stiffness_is_found_among_fixtures():
    rng, fixtures = np.random.default_rng(2), pegs((0.25, 0.03))
    moves = np.column_stack([rng.uniform(-0.08, 0.08, (3, 2)), rng.uniform(-0.7, 0.7, 3)])
    edges, before = np.array([4, 12, 26]), np.repeat(straight(0.0)[None], 3, 0)
    for true in (0.055, 0.6):
        after = World(fixtures, Limits(), true).ways(before, edges, moves)[:, -1]
        assert (
            abs(
                np.log(
                    likely_stiffness(World(fixtures, Limits()), before, edges, moves, after) / true
                )
            )
            < 0.7
        )


def test_a_dlo_on_the_wrong_side_of_a_peg_is_threaded_around_it():
    """By the model's own foresight, from below a peg to above it; in straight distances a plan
    rests at the peg."""
    peg = np.array([0.32, 0.03])
    fixtures, state = pegs((0.32, 0.03), radius=0.016), straight(0.0, 0.4)
    route = Route([Stop(peg, 0.016, -1)], 0.02, state[0])
    goal, world = Goal(route.shape(0.4, FINE), route), World(fixtures, Limits())
    assert route.missed(state) == [0]
    for _ in range(8):
        state = routed(world, state, goal, most=1).predicted[0]
        if goal.reached(state, fixtures, 0.0):
            break
    assert route.missed(state) == []
    assert fixtures.gap(state[:-1], state[1:]).min() > -0.002


def test_the_gripper_keeps_out_of_areas_on_its_whole_way():
    """The way was looked at in 21 points: a narrow area between two of them was passed through."""
    thin = np.array([[0.0511, -1.0], [0.0513, -1.0], [0.0513, 1.0], [0.0511, 1.0]])
    assert carried_into(np.zeros(2), np.array([0.1, 0.0]), 0.0, thin)
    beside = np.array([[0.0, 0.02], [0.1, 0.02], [0.1, 0.05]])
    assert not carried_into(np.zeros(2), np.array([0.1, 0.0]), 0.015, beside)
    assert carried_into(np.zeros(2), np.array([0.1, 0.0]), 0.025, beside)


def test_the_rough_look_keeps_what_is_best():
    """Of all actions that are possible, looked at exactly, none is better than those that were
    picked roughly."""
    fixtures, state = pegs((0.25, 0.035), radius=0.014), straight(0.0)
    goal, world = Goal(straight(0.07, x=0.02)), World(fixtures, Limits())
    found = routed(world, state, goal, most=3)
    edges, moves = _proposed(world, state, goal)
    rows = _reachable(world, state, edges, moves)
    every = _foreseen(world, state, goal, edges[rows], moves[rows], most=1)
    assert found.error[0] <= every.error[0] + 1e-9
    assert (np.diff(found.error) >= 0).all()
    assert len(rows) > 3 * routing._PROMISING


def test_stops_are_missed_one_by_one_as_many_at_once():
    clip = Clip(np.array([0.3, 0.0]), 0.0, 0.003)
    route = Route([Stop(PEG, 0.02, 1), Stop(clip.xy, clip=clip)], 0.03, np.zeros(2))
    shapes = np.stack([straight(y) for y in (-0.03, 0.0, 0.001, 0.05)])
    assert route.misses(shapes).tolist() == [len(route.missed(s)) for s in shapes]
    held = Fixtures(clips=[clip, Clip(np.array([0.3, -0.03]), 0.0, 0.003)]).filled(shapes)
    assert held.tolist() == [[False, True], [True, False], [True, False], [False, False]]
