"""The shape controller, the simulated table and what is drawn of a task, against the real
stages."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from dlo_client import AsyncClient, InvalidArgument
from dlo_client.contracts import DloObject, Peg, PlannedAction, Route, RouteStop
from dlo_client.demo.shape_drawing import animate, plot
from dlo_client.demo.simulated_table import SimulatedTable, target_shape
from dlo_client.shape_control import ShapeController, mean_distance
from PIL import Image

from workers import stages
from workers.settings import Settings

OBJECT = DloObject(mass_kg=0.05)


class StageClient:
    """Runs a request in this process, as a worker would."""

    def __init__(self, tools) -> None:
        self.tools, self.requests = tools, []

    def run(self, request):
        self.requests.append(request)
        return stages.run(request, self.tools).result


@pytest.fixture(scope="module")
def client(tmp_path_factory) -> StageClient:
    return StageClient(
        stages.warm(Settings(data_dir=tmp_path_factory.mktemp("data"), onnx_threads=1))
    )


def moved(edge: int, dx: float, dy: float, turn: float) -> PlannedAction:
    grip = {"xy_m": (0, 0), "angle_rad": 0}
    return PlannedAction.model_validate(
        {
            "edge": edge,
            "dx_m": dx,
            "dy_m": dy,
            "dtheta_rad": turn,
            "pick": grip,
            "place": grip,
            "checks": [],
        }
        | {"error_after_m": 0, "error_at_end_m": 0, "converged": True}
    )


def test_the_simulated_rope_keeps_its_length_and_follows_the_gripper():
    table = SimulatedTable(0.45)
    before = table.observe()
    table.execute(moved(3, 0.02, 0.08, 0.5))
    after = table.observe()
    middle = np.mean(before[3:5], axis=0) + np.array([0.02, 0.08])
    assert np.mean(after[3:5], axis=0) == pytest.approx(middle, abs=1e-9)
    lengths = [math.dist(a, b) for a, b in pairwise(after)]
    assert lengths == pytest.approx([0.03] * 15, rel=0.02)
    assert math.dist(before[-1], after[-1]) < 0.03


def test_a_route_in_place_of_a_target(client):
    table = SimulatedTable(0.45)
    peg = Peg(kind="peg", xy_m=(0.05, 0.04), radius_m=0.01)
    route = Route(stops=[RouteStop(fixture=0, side="right")])
    plan = ShapeController(client, table, OBJECT, None, fixtures=[peg], route=route).plan(
        table.observe()
    )
    assert client.requests[-1].target_m is None
    assert plan.stops_left == [0]
    assert plan.action is not None


@pytest.mark.parametrize("name", ["U", "A", "S", "I"])
def test_targets_have_the_rope_s_length_and_lie_in_the_middle(name):
    shape = target_shape(name, 0.45)
    assert sum(math.dist(a, b) for a, b in pairwise(shape)) == pytest.approx(0.45)
    assert np.mean(shape, axis=0) == pytest.approx([0, 0], abs=1e-9)


def test_a_target_that_there_is_not():
    with pytest.raises(ValueError, match="U, A, S, I"):
        target_shape("Q")


@pytest.mark.slow
def test_a_shape_is_reached_and_the_rope_learnt(client, tmp_path):
    table, target = SimulatedTable(0.45), target_shape("U", 0.45)
    controller = ShapeController(client, table, OBJECT, target)
    outcome = controller.run()
    assert outcome.reached, outcome.errors_m
    assert outcome.errors_m[-1] <= 0.01 < outcome.errors_m[0]
    assert len(controller.history) == len(outcome.steps) <= 10
    assert outcome.steps[0].plan.parameters.source == "mid_range"
    assert outcome.parameters[-1].source == "history"
    assert mean_distance(table.observe(), target) == pytest.approx(outcome.errors_m[-1], abs=1e-4)
    animate(table.frames, target, tmp_path / "task.gif")
    plot(outcome, 0.01, tmp_path / "task.png")
    with Image.open(tmp_path / "task.gif") as picture:
        assert picture.n_frames > 20
    with Image.open(tmp_path / "task.png") as picture:
        assert picture.size == (640, 570)


class ArrayTable(SimulatedTable):
    """Sees the rope as an array, as a camera's program does."""

    def observe(self):
        return np.asarray(super().observe())


def test_a_robot_may_see_in_arrays(client):
    target = np.asarray(target_shape("U", 0.45))
    outcome = ShapeController(client, ArrayTable(0.45), OBJECT, target, max_actions=1).run()
    assert len(outcome.steps) == 1
    assert outcome.errors_m[1] < outcome.errors_m[0]


@pytest.mark.parametrize("target", [np.zeros((4, 3)), [1.0, 2.0], None, "ab"])
def test_a_target_that_is_no_line_of_points_is_named(client, target):
    with pytest.raises(InvalidArgument, match=r"^target_m: takes"):
        ShapeController(client, SimulatedTable(0.45), OBJECT, target)


def test_an_asynchronous_client_is_refused_by_name():
    """It ended in "'coroutine' object has no attribute 'state'" after the robot had been asked."""
    with pytest.raises(
        InvalidArgument, match="ShapeController waits for answers: give it a Client"
    ):
        ShapeController(
            AsyncClient("http://service"), SimulatedTable(0.45), OBJECT, target_shape("U")
        )


def test_it_stops_after_the_actions_it_may_do(client):
    controller = ShapeController(
        client, SimulatedTable(0.45), OBJECT, target_shape("S", 0.45), 1e-4, max_actions=2
    )
    outcome = controller.run()
    assert not outcome.reached
    assert len(outcome.steps) == 2
    assert len(outcome.errors_m) == 3


class GluedTable(SimulatedTable):
    """A rope that nothing moves."""

    def execute(self, action):
        pass


@pytest.mark.slow
def test_it_stops_when_the_actions_bring_nothing(client):
    """All ten actions were done on a rope that had come to rest after three."""
    controller = ShapeController(client, GluedTable(0.45), OBJECT, target_shape("S", 0.45))
    outcome = controller.run()
    assert not outcome.reached
    assert len(outcome.steps) == 4
    assert "no nearer" in outcome.reason


def test_without_learning_nothing_is_told(client):
    asked = len(client.requests)
    controller = ShapeController(
        client,
        SimulatedTable(0.45),
        OBJECT,
        target_shape("S", 0.45),
        max_actions=2,
        horizon=1,
        learn=False,
    )
    controller.run()
    assert all(request.history == [] for request in client.requests[asked:])
    assert len(controller.history) == 2


def test_distance_of_shapes_of_other_sizes_is_not_a_number():
    assert math.isnan(mean_distance([(0, 0)], [(0, 0), (1, 1)]))
