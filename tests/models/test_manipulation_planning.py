"""Optimizers and the planner on dynamics whose best action is known, and on the shipped network."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from models.manipulation import planning
from models.manipulation.actions import best_actions, onto_target
from models.manipulation.belief import Belief
from models.manipulation.dynamics import Dynamics, shape_distance
from models.manipulation.least_squares import SolverParams, minimize
from models.manipulation.limits import Limits, checks, inside
from models.manipulation.parameters import MID_RANGE, History, estimate
from models.manipulation.planning import plan
from models.manipulation.resampling import (
    back_to_points,
    edge_of_points,
    node_edge_of,
    node_edges_within,
    to_nodes,
)
from models.manipulation.scaling import MOVE_SCALE, scale_rope
from models.manipulation.simulator import Actions, Ropes, SimulationParams, simulate, straight
from models.manipulation.swept import enters, ways
from models.training.dynamics.data import generate
from models.training.dynamics.network_dynamics import DynamicsNetwork
from models.training.dynamics.network_tangents import DynamicsTangents
from models.training.dynamics.train import example
from models.weights.inference import Runtime, load

STATE = straight(np.array([0.45]), 16)[0]
ROPE = np.array([0.05, *MID_RANGE])


class Towed:
    """Every node goes along with the gripped edge, less the farther away: w = 1 / (1 + |i - edge|);
    no turning."""

    def predict(self, states, edges, moves, rope):
        return states + self._weights(states, edges)[..., None] * moves[:, None, :2]

    def by_move(self, states, edges, moves, rope):
        weights = self._weights(states, edges)
        slopes = np.zeros((*states.shape, 3))
        slopes[..., 0, 0] = slopes[..., 1, 1] = weights
        return self.predict(states, edges, moves, rope), slopes

    @staticmethod
    def _weights(states, edges):
        return 1 / (1 + np.abs(np.arange(states.shape[1]) - edges[:, None]))


TOWED = Belief.certain(Towed(), ROPE)


@pytest.fixture(scope="module")
def shipped() -> Dynamics:
    runtime = Runtime(threads=1)
    return Dynamics(
        *(load(n, runtime) for n in ("dynamics", "dynamics_by_move", "dynamics_by_rope"))
    )


def test_the_solver_finds_known_minima_of_many_problems_at_once():
    """Two distances to x and y of a point: the minimum is the point itself; a box holds the third
    back."""
    points = np.array([[0.3, -0.2], [0.0, 0.0], [3.0, 0.1]])

    def residuals(x):
        r = (x - points)[:, None]
        return r, np.broadcast_to(np.eye(2), (len(x), 1, 2, 2))

    found = minimize(
        residuals, np.full((3, 2), 0.5), -np.ones(2), np.ones(2), np.ones(2), SolverParams(steps=20)
    )
    assert found.x == pytest.approx(np.array([[0.3, -0.2], [0.0, 0.0], [1.0, 0.1]]), abs=1e-3)
    assert found.cost == pytest.approx([0, 0, 2.0], abs=1e-3)


def test_the_best_action_is_the_one_that_made_the_target():
    """Gripping edge 5 by (0.04, -0.03) makes the target; no other edge can."""
    target = Towed().predict(STATE[None], np.array([5]), np.array([[0.04, -0.03, 0]]), ROPE)[0]
    found = best_actions(Towed(), STATE, target, ROPE, np.arange(15))
    assert found.edge[0] == 5
    assert found.move[0, :2] == pytest.approx([0.04, -0.03], abs=1e-3)
    assert found.error[0] < 1e-4
    assert (np.diff(found.error) >= 0).all()
    assert sorted(found.edge) == list(range(15))


def test_edges_onto_their_target():
    target = STATE @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + [0.1, 0.2]
    moves = onto_target(STATE, target, np.array([7]))
    assert moves[0] == pytest.approx([0.1, 0.2, np.pi / 2])


def test_two_steps_reach_what_one_cannot():
    target = STATE + np.array([0.0, 0.15])
    greedy, ends = plan(TOWED, STATE, target, Limits(), 1)
    ahead, ends_ahead = plan(TOWED, STATE, target, Limits(), 3)
    assert ends_ahead[0] < ends[0]
    assert len(greedy.edge) == len(ahead.edge) == 15
    assert len(set(ahead.edge.tolist())) == 15


@pytest.mark.parametrize("horizon", [1, 2])
def test_an_optimizer_that_was_cut_short_is_no_optimum(monkeypatch, horizon):
    """Every action was stated to be one."""
    target = STATE + 0.03 * np.sin(np.linspace(0, 9, 16))[:, None]
    at_rest, _ = plan(TOWED, STATE, target, Limits(), horizon)
    assert at_rest.converged.any()
    monkeypatch.setattr(planning, "_FIRST", SolverParams(steps=1))
    monkeypatch.setattr(planning, "_TOGETHER", SolverParams(steps=1))
    cut, _ = plan(TOWED, STATE, target, Limits(), horizon)
    assert not cut.converged.all()


def test_limits_bind():
    target = STATE + np.array([0.05, 0.05])
    box = np.array([[-0.3, -0.01], [0.3, 0.03]])
    found, _ = plan(TOWED, STATE, target, Limits(box=box, no_grasp=(7, 8), shift=0.02), 1)
    assert not {7, 8} & set(found.edge.tolist())
    assert np.abs(found.move[:, :2]).max() <= 0.02 + 1e-12
    assert all(
        c.passed for k in range(len(found.edge)) for c in checks(STATE, found, k, Limits(box=box))
    )
    assert found.predicted[..., 1].max() <= 0.03


def test_no_action_is_left_where_nothing_is_allowed():
    nowhere = Limits(base=np.array([5.0, 5.0]), reach=(0.0, 0.5))
    assert len(plan(TOWED, STATE, STATE + 0.05, nowhere, 2)[0].edge) == 0


def test_a_keep_out_zone_is_kept_out_of():
    zone = np.array([[-0.3, 0.02], [0.3, 0.02], [0.3, 0.2], [-0.3, 0.2]])
    found, _ = plan(TOWED, STATE, STATE + np.array([0.0, 0.05]), Limits(zones=[zone]), 1)
    assert not any(inside(p, zone).any() for p in found.predicted)


def test_a_keep_out_zone_is_not_swept_on_the_way():
    """Only where the DLO came to rest was looked at: it passed over an area of 1 cm on its way."""
    post = np.array([[0.001, 0.03], [0.006, 0.03], [0.004, 0.036]])
    target = STATE + np.array([0.0, 0.08])
    assert not inside(target, post).any()
    free, _ = plan(TOWED, STATE, target, Limits(), 1)
    assert any(enters(way, post) for way in ways(TOWED, STATE, free))
    found, _ = plan(TOWED, STATE, target, Limits(zones=[post]), 1)
    assert not any(enters(way, post) for way in ways(TOWED, STATE, found))
    assert len(found.edge) < 15


def test_what_a_line_sweeps():
    line = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 1.0]]])

    def at(x: float, y: float) -> np.ndarray:
        return np.array([[x, y], [x + 0.01, y], [x, y + 0.01]])

    assert enters(line, at(0.4, 0.5))
    assert enters(line, at(0.9, 0.05))
    assert not enters(line, at(1.1, 0.5))
    assert not enters(line, at(0.4, 1.1))
    assert enters(line, 10 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]))
    twice = np.concatenate([line, line[1:]])
    assert not enters(twice, at(0.4, 1.1)), "a line that stays sweeps nothing"


def test_points_in_a_polygon():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    points = np.array([[0.5, 0.5], [1.5, 0.5], [-0.1, 0.2], [0.99, 0.01]])
    assert inside(points, square).tolist() == [True, False, False, True]


def test_any_number_of_points_and_back():
    line = np.column_stack([np.linspace(0, 0.4, 5), np.zeros(5)])
    nodes = to_nodes(line)
    assert nodes[:, 0] == pytest.approx(np.linspace(0, 0.4, 16))
    moved = nodes + np.column_stack([np.zeros(16), nodes[:, 0]])
    assert back_to_points(line, nodes, moved)[:, 1] == pytest.approx(line[:, 0])
    assert [edge_of_points(line, k) for k in (0, 6, 14)] == [0, 1, 3]
    assert node_edge_of(line, 2) == 9
    assert node_edges_within(line, [3]) == [11, 12, 13, 14]
    assert to_nodes(nodes) is nodes


def test_two_points_and_repeated_points_are_a_line():
    assert to_nodes(np.array([[0.0, 0.0], [0.3, 0.0]])).shape == (16, 2)
    repeated = np.array([[0, 0], [0, 0], [0.1, 0], [0.1, 0], [0.3, 0.0]])
    assert to_nodes(repeated)[:, 0] == pytest.approx(np.linspace(0, 0.3, 16))


def test_the_least_of_every_parameter_is_zero():
    assert scale_rope(np.array([0.02, 0.05, 3.0])) == pytest.approx([0, 0, 0])


def test_derivatives_by_hand_are_those_of_autograd():
    torch.manual_seed(0)
    network = DynamicsNetwork(width=24, blocks=2).eval().requires_grad_(False)
    torch.nn.init.normal_(network.leave[1].weight, 0, 0.2)
    inputs = example(5)

    def one(state, edge, move, rope):
        return network(state[None], edge[None], move[None], rope[None])[0]

    by_move, by_rope = torch.func.vmap(torch.func.jacfwd(one, argnums=(2, 3)))(*inputs)
    for variables, expected in (("move", by_move), ("rope", by_rope[..., 1:])):
        value, slopes = DynamicsTangents(network, variables)(*inputs)
        assert (value - network(*inputs)).abs().max() < 1e-6
        assert (slopes - expected).abs().max() < 1e-5


def test_world_derivatives_are_differences(shipped):
    rng = np.random.default_rng(0)
    seen = generate(rng, 6, 1, Ropes.random(rng, 6))
    before, move = seen.before.astype(float), seen.move.astype(float)
    rope = seen.rope[:, :3].astype(float)
    value, slopes = shipped.by_move(before, seen.edge, move, rope)
    assert np.abs(value - shipped.predict(before, seen.edge, move, rope)).max() < 1e-5
    for k, step in enumerate((2e-3, 2e-3, 2e-2)):
        ahead, behind = (
            shipped.predict(before, seen.edge, move + sign * step * np.eye(3)[k], rope)
            for sign in (1, -1)
        )
        assert np.abs((ahead - behind) / (2 * step) - slopes[..., k]).max() < 0.03
    _, by_rope = shipped.by_rope(before, seen.edge, move, rope)
    for k, step in enumerate((0.01, 0.3)):
        ahead, behind = (
            shipped.predict(before, seen.edge, move, rope + sign * step * np.eye(3)[k + 1])
            for sign in (1, -1)
        )
        assert (
            np.abs((ahead - behind) / (2 * step) - by_rope[..., k]).max()
            < 0.05 * np.abs(by_rope[..., k]).max()
        )


def test_the_shipped_network_predicts_what_it_never_saw(shipped):
    """The floor of 10 % of the mean displacement."""
    rng = np.random.default_rng(123)
    seen = generate(rng, 100, 5, Ropes.random(rng, 100))
    reached = shipped.predict(
        seen.before.astype(float),
        seen.edge,
        seen.move.astype(float),
        seen.rope[:, :3].astype(float),
    )
    moved = shape_distance(seen.before, seen.after).mean()
    assert shape_distance(reached, seen.after).mean() / moved < 0.1


def test_equal_requests_have_equal_answers(shipped):
    target = STATE + 0.03 * np.sin(np.linspace(0, 6, 16))[:, None]
    first, second = (plan(Belief.certain(shipped, ROPE), STATE, target, Limits(), 2) for _ in "ab")
    assert np.array_equal(first[0].move, second[0].move)
    assert np.array_equal(first[1], second[1])


def played(rope: Ropes, actions: int, seed: int) -> History:
    rng = np.random.default_rng(seed)
    state, parts = straight(rope.length, 16), []
    for _ in range(actions):
        act = Actions.random(rng, 1, 16)
        after = simulate(state, act, rope, SimulationParams(steps=80))
        parts.append((state[0], act.edge[0], np.append(act.shift[0], act.turn[0]), after[0]))
        state = after
    return History(*(np.array([part[k] for part in parts]) for k in range(4)))


@pytest.mark.parametrize(("bending", "damping"), [(0.1, 20.0), (0.7, 8.0)])
def test_hidden_parameters_are_found(shipped, bending, damping):
    history = played(Ropes.same(1, 0.05, bending, damping, 0.45), 5, seed=1)
    found = estimate(shipped, history, 0.05)
    assert found.bending / found.damping == pytest.approx(bending / damping, rel=0.15)
    assert found.bending == pytest.approx(bending, rel=0.25)
    assert found.error_m.mean() < 0.3 * found.error_before_m.mean()
    assert found.ratio_sigma < found.sigma.max()


def test_without_history_the_middle_is_assumed(shipped):
    empty = np.zeros((0, 16, 2))
    found = estimate(shipped, History(empty, np.zeros(0, np.int64), np.zeros((0, 3)), empty), 0.05)
    assert (found.bending, found.damping) == MID_RANGE
    assert found.sigma.min() > 0.5


def test_one_wrong_item_does_not_spoil_the_others(shipped):
    history = played(Ropes.same(1, 0.05, 0.1, 20.0, 0.45), 6, seed=2)
    wrong = history.after.copy()
    wrong[3] += 0.08
    found = estimate(shipped, History(history.before, history.edge, history.move, wrong), 0.05)
    assert found.bending / found.damping == pytest.approx(0.005, rel=0.35)
    assert np.argmax(found.error_m) == 3


def test_moves_stay_in_the_trained_range(shipped):
    found = best_actions(shipped, STATE, STATE + 1.0, ROPE, np.arange(15))
    assert (np.abs(found.move) <= MOVE_SCALE + 1e-12).all()
