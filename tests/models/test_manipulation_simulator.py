"""The analytical model: its energy, its forces, momentum, rest, refinement of the step, and forward
Euler."""

from __future__ import annotations

import numpy as np
import pytest

from models.manipulation.simulator import (
    Actions,
    Ropes,
    SimulationParams,
    bend_angles,
    edge_lengths,
    energy,
    forces_and_stiffness,
    simulate,
    straight,
)
from models.training.dynamics.data import MID_RANGE, generate, mid_range, nearly_straight

ROPE = Ropes.same(1, 0.05, 0.2, 10.0, 0.45)
PARAMS = SimulationParams()


def bent(seed: int, count: int = 3, nodes: int = 7) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return nearly_straight(rng, np.full(count, 0.3), nodes) + rng.normal(0, 0.01, (count, nodes, 2))


def action(
    edge: int, dx: float = 0.0, dy: float = 0.0, turn: float = 0.0, count: int = 1
) -> Actions:
    return Actions(np.full(count, edge), np.tile([dx, dy], (count, 1)), np.full(count, turn))


def test_a_right_angle_by_hand():
    """Three nodes, edges of 0.1 m at a right angle: the energy is k_b (pi/2)^2 / 2, and nothing is
    stretched."""
    state = np.array([[[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]]])
    rope = Ropes.same(1, 0.05, 0.3, 10.0, 0.2)
    assert bend_angles(state)[0, 0] == pytest.approx(np.pi / 2)
    assert energy(state, rope, PARAMS)[0] == pytest.approx(0.15 * (np.pi / 2) ** 2)
    force = forces_and_stiffness(state, rope, PARAMS)[0].reshape(3, 2)
    # k_b beta / l, across each edge, so that the ends are driven back towards a line (eq. 5.3).
    assert force[2] == pytest.approx([0.3 * np.pi / 2 / 0.1, 0.0], abs=1e-9)
    assert force[0] == pytest.approx([0.0, -0.3 * np.pi / 2 / 0.1], abs=1e-9)


def test_forces_are_the_negative_gradient_of_the_energy():
    state, rope = bent(1), Ropes.same(3, 0.05, 0.4, 10.0, 0.3)
    force = forces_and_stiffness(state, rope, PARAMS)[0].reshape(state.shape)
    for node in range(state.shape[1]):
        for axis in (0, 1):
            shifted = [state.copy(), state.copy()]
            shifted[0][:, node, axis] += 1e-6
            shifted[1][:, node, axis] -= 1e-6
            slope = (energy(shifted[0], rope, PARAMS) - energy(shifted[1], rope, PARAMS)) / 2e-6
            assert force[:, node, axis] == pytest.approx(-slope, rel=1e-5, abs=1e-4)


def test_springs_change_neither_momentum_nor_angular_momentum():
    state, rope = bent(2), Ropes.same(3, 0.05, 0.4, 10.0, 0.3)
    force = forces_and_stiffness(state, rope, PARAMS)[0].reshape(state.shape)
    size = np.abs(force).max()
    assert np.abs(force.sum(1)).max() < 1e-9 * size
    torque = (state[..., 0] * force[..., 1] - state[..., 1] * force[..., 0]).sum(1)
    assert np.abs(torque).max() < 1e-9 * size


def test_a_straight_cable_that_is_held_still_stays():
    state = straight(ROPE.length, 16)
    assert np.abs(simulate(state, action(7), ROPE) - state).max() < 1e-12


def test_a_bent_cable_relaxes_towards_straight():
    rope = Ropes.same(1, 0.05, 1.0, 3.0, 0.3)
    state = nearly_straight(np.random.default_rng(3), rope.length)
    after = simulate(state, action(7), rope)
    assert energy(after, rope, PARAMS)[0] < 0.5 * energy(state, rope, PARAMS)[0]


def test_the_gripped_edge_goes_exactly_where_it_is_taken():
    state = straight(ROPE.length, 16)
    after = simulate(state, action(4, 0.03, 0.05, 0.6), ROPE)[0]
    middle = state[0, 4:6].mean(0)
    assert after[4:6].mean(0) == pytest.approx(middle + np.array([0.03, 0.05]), abs=1e-9)
    heading = np.arctan2(*(after[5] - after[4])[::-1])
    assert heading == pytest.approx(0.6, abs=1e-9)


def test_a_stiff_cable_turns_more_of_itself_than_a_limp_one():
    limp, stiff = (Ropes.same(1, 0.05, k_b, 20.0, 0.45) for k_b in (0.05, 1.0))
    state = straight(limp.length, 16)
    moved = [
        np.hypot(*(simulate(state, action(0, 0, 0.1), rope) - state)[0].T) for rope in (limp, stiff)
    ]
    assert (moved[1][3:7] > moved[0][3:7]).all()


def test_lengths_hardly_change():
    rng = np.random.default_rng(4)
    ropes = Ropes.random(rng, 50)
    after = simulate(straight(ropes.length, 16), Actions.random(rng, 50, 16), ropes)
    stretch = edge_lengths(after)[1] / (ropes.length[:, None] / 15) - 1
    assert np.abs(stretch).mean() < 0.02


@pytest.mark.slow
def test_a_finer_step_changes_little_and_less_the_finer():
    rng = np.random.default_rng(5)
    ropes, acts = Ropes.random(rng, 30), Actions.random(rng, 30, 16)
    state = straight(ropes.length, 16)
    exact = simulate(state, acts, ropes, SimulationParams(steps=640))
    errors = []
    for steps in (20, 40, 80):
        off = np.hypot(
            *np.moveaxis(simulate(state, acts, ropes, SimulationParams(steps=steps)) - exact, -1, 0)
        )
        errors.append(off.mean() / np.hypot(*np.moveaxis(exact - state, -1, 0)).mean())
    assert errors[1] < 0.01
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.slow
def test_forward_euler_with_tiny_steps_gives_the_same():
    """The thesis's integration of eq. 5.1, for a rope soft enough that it is stable at 10
    microseconds."""
    rope = Ropes.same(1, 0.1, 0.1, 20.0, 0.5)
    act, params = (
        action(3, 0.02, 0.02, 0.3),
        SimulationParams(axial=3e3, duration_s=0.15, steps=200),
    )
    state = straight(rope.length, 16)
    position, velocity = state.copy(), np.zeros_like(state)
    steps = 15_000
    dt = params.duration_s / steps
    turn_rate, speed = 0.3 / params.duration_s, np.array([0.02, 0.02]) / params.duration_s
    middle = state[0, 3:5].mean(0)
    for n in range(steps):
        force = forces_and_stiffness(position, rope, params)[0].reshape(state.shape)
        velocity = velocity + dt * (force - 20.0 * velocity) / (0.1 / 16)
        arm = position[0, 3:5] - middle - speed * n * dt
        velocity[0, 3:5] = speed + turn_rate * np.stack([-arm[:, 1], arm[:, 0]], 1)
        position = position + dt * velocity
    ours = simulate(state, act, rope, params)
    assert np.hypot(*(position - ours)[0].T).max() < 3e-4


def test_turning_the_table_turns_the_answer():
    state = nearly_straight(np.random.default_rng(6), ROPE.length)
    cos, sin = np.cos(1.1), np.sin(1.1)
    turn = np.array([[cos, -sin], [sin, cos]])
    plain = simulate(state, action(9, 0.05, -0.02, 0.4), ROPE)
    shifted = np.array([[0.05, -0.02]]) @ turn.T
    turned = simulate(state @ turn.T + 0.3, Actions(np.array([9]), shifted, np.array([0.4])), ROPE)
    assert np.abs(turned - (plain @ turn.T + 0.3)).max() < 1e-9


def test_samples_follow_one_another_and_the_seed_decides():
    first, second = (
        generate(np.random.default_rng(7), 4, 3, Ropes.random(np.random.default_rng(8), 4))
        for _ in "ab"
    )
    assert len(first) == 12
    assert all(
        np.array_equal(getattr(first, n), getattr(second, n)) for n in first.__dataclass_fields__
    )
    assert np.array_equal(first.before[4:8], first.after[:4])
    assert np.ptp(first.rope[::4], axis=0).max() == 0


def test_the_mid_range_is_fixed_but_for_the_length():
    ropes = mid_range(np.random.default_rng(9), 20)
    assert set(ropes.bending) == {MID_RANGE["bending"]}
    assert 0.4 <= ropes.length.min() < ropes.length.max() <= 0.5
