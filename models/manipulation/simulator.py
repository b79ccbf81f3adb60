"""The analytical model of thesis section 5.3.1 for many DLOs at once: masses, axial and bending
springs, damping.

Strategy: the springs' energy is E = sum k_s (l_i - l0)^2 / 2 + sum k_b beta_i^2 / 2; its negative
gradient is what eq. 5.2 and 5.3 write out for the plane. With the thesis's parameters these springs
are so stiff that forward Euler needs steps of 20 microseconds. Here each step is linearly implicit:
(M + dt D + dt^2 H) dv = dt (f - D v - dt H v) with the Gauss-Newton part H of the Hessian, one
small dense system a simulation, all solved in one call. The two nodes of the gripped edge follow
the gripper exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MASS_KG = (0.02, 0.1)
BENDING = (0.05, 1.0)
DAMPING = (3.0, 30.0)
LENGTH_M = (0.15, 0.5)
LARGEST_SHIFT_M = 0.1
LARGEST_TURN_RAD = np.pi / 4
"""The ranges of thesis section 5.7.1."""


@dataclass(frozen=True)
class SimulationParams:
    """``axial`` k_s in N/m, so high that lengths change by about 1 % (5.4.1); ``duration_s`` of the
    gripper's way and ``steps`` it is cut into."""

    axial: float = 3e4
    duration_s: float = 1.0
    steps: int = 40


@dataclass(frozen=True, eq=False)
class Ropes:
    """B DLOs: ``mass`` (B,) kg, ``bending`` (B,) k_b in N m/rad a joint, ``damping`` (B,) k_d in N
    s/m a node, ``length`` (B,) m. Mass and length are spread evenly over nodes and edges."""

    mass: FloatArray
    bending: FloatArray
    damping: FloatArray
    length: FloatArray

    @staticmethod
    def random(rng: np.random.Generator, count: int) -> Ropes:
        """Uniform over the thesis's ranges."""
        ranges = (MASS_KG, BENDING, DAMPING, LENGTH_M)
        return Ropes(*(rng.uniform(*bounds, count) for bounds in ranges))

    @staticmethod
    def same(count: int, mass: float, bending: float, damping: float, length: float) -> Ropes:
        return Ropes(*(np.full(count, value) for value in (mass, bending, damping, length)))


@dataclass(frozen=True, eq=False)
class Actions:
    """``edge`` (B,) from 0 to n - 2, ``shift`` (B, 2) m, ``turn`` (B,) rad (eq. 5.4)."""

    edge: IntArray
    shift: FloatArray
    turn: FloatArray

    @staticmethod
    def random(rng: np.random.Generator, count: int, nodes: int) -> Actions:
        """Uniform over the thesis's ranges."""
        shift = rng.uniform(-LARGEST_SHIFT_M, LARGEST_SHIFT_M, (count, 2))
        turn = rng.uniform(-LARGEST_TURN_RAD, LARGEST_TURN_RAD, count)
        return Actions(rng.integers(0, nodes - 1, count), shift, turn)


def edge_lengths(states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Edge vectors (B, n - 1, 2) and their lengths (B, n - 1)."""
    edges = np.diff(states, axis=1)
    return edges, np.hypot(edges[..., 0], edges[..., 1])


def bend_angles(states: FloatArray) -> FloatArray:
    """Signed angles beta between neighboring edges, (B, n - 2) rad."""
    e = np.diff(states, axis=1)
    a, b = e[:, :-1], e[:, 1:]
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.arctan2(cross, (a * b).sum(-1))


def energy(states: FloatArray, ropes: Ropes, params: SimulationParams) -> FloatArray:
    """Of all springs, (B,) J."""
    lengths = edge_lengths(states)[1]
    rest = ropes.length[:, None] / lengths.shape[1]
    stretch = 0.5 * params.axial * ((lengths - rest) ** 2).sum(1)
    bend = 0.5 * ropes.bending * (bend_angles(states) ** 2).sum(1)
    return np.asarray(stretch + bend)


def forces_and_stiffness(
    states: FloatArray, ropes: Ropes, params: SimulationParams
) -> tuple[FloatArray, FloatArray]:
    """Spring forces (B, 2n) and the Gauss-Newton stiffness (B, 2n, 2n), positive semidefinite.

    Every spring's energy is k r^2 / 2 of one residual r (a length or an angle), so with its
    gradient g the force is -k r g and the stiffness k g g^T. ``rows`` of the Jacobian are all these
    gradients.
    """
    batch, nodes, _ = states.shape
    edges, lengths = edge_lengths(states)
    along = edges / lengths[..., None]
    normal = (
        np.stack([-along[..., 1], along[..., 0]], -1) / lengths[..., None]
    )  # d(heading) / d(edge)
    joints, links = np.arange(nodes - 2), np.arange(nodes - 1)
    stretch = np.zeros((batch, nodes - 1, nodes, 2))
    stretch[:, links, links], stretch[:, links, links + 1] = -along, along
    bend = np.zeros((batch, nodes - 2, nodes, 2))
    bend[:, joints, joints] = normal[:, :-1]
    bend[:, joints, joints + 1] = -normal[:, 1:] - normal[:, :-1]
    bend[:, joints, joints + 2] = normal[:, 1:]
    rows = np.concatenate([stretch, bend], 1).reshape(batch, -1, 2 * nodes)
    residual = np.concatenate(
        [lengths - ropes.length[:, None] / (nodes - 1), bend_angles(states)], 1
    )
    stiffness = np.concatenate(
        [
            np.full((batch, nodes - 1), params.axial),
            np.repeat(ropes.bending[:, None], nodes - 2, 1),
        ],
        1,
    )
    weighted = rows * stiffness[..., None]
    force = -np.matmul(residual[:, None], weighted)[:, 0]
    return force, np.matmul(weighted.transpose(0, 2, 1), rows)


def simulate(
    states: FloatArray, actions: Actions, ropes: Ropes, params: SimulationParams | None = None
) -> FloatArray:
    """(B, n, 2) states to those when the gripper has arrived; the DLO rests before, and stays where
    it is after."""
    params = params or SimulationParams()
    positions = np.array(states, dtype=np.float64)
    batch, nodes, _ = positions.shape
    step = params.duration_s / params.steps
    velocity = np.zeros((batch, 2 * nodes))
    inertia = np.repeat((ropes.mass / nodes)[:, None], 2 * nodes, 1)
    drag = np.repeat(ropes.damping[:, None], 2 * nodes, 1)
    sims = np.arange(batch)
    gripper = np.zeros((batch, nodes, 2), bool)
    gripper[sims, actions.edge] = gripper[sims, actions.edge + 1] = True
    held = gripper.reshape(batch, 2 * nodes)
    start = positions.copy()
    diagonal = np.arange(2 * nodes)
    for k in range(1, params.steps + 1):
        wanted = gripped(start, actions, k / params.steps)
        imposed = np.zeros((batch, nodes, 2))
        imposed[sims, actions.edge] = (wanted[:, 0] - positions[sims, actions.edge]) / step
        imposed[sims, actions.edge + 1] = (wanted[:, 1] - positions[sims, actions.edge + 1]) / step
        change = imposed.reshape(batch, -1) - velocity
        force, stiffness = forces_and_stiffness(positions, ropes, params)
        system = step**2 * stiffness
        system[:, diagonal, diagonal] += inertia + step * drag
        right = step * (
            force - drag * velocity - step * np.matmul(stiffness, velocity[..., None])[..., 0]
        )
        right -= np.matmul(system, np.where(held, change, 0.0)[..., None])[..., 0]
        free = ~held
        system *= free[:, :, None] & free[:, None, :]
        system[:, diagonal, diagonal] += held
        solved = np.linalg.solve(system, np.where(held, 0.0, right)[..., None])[..., 0]
        velocity = velocity + np.where(held, change, solved)
        positions = positions + step * velocity.reshape(batch, nodes, 2)
    return positions


def gripped(start: FloatArray, actions: Actions, share: float) -> FloatArray:
    """Where the two nodes of the gripped edge are after this share of the way, (B, 2, 2)."""
    sims = np.arange(len(start))
    pair = np.stack([start[sims, actions.edge], start[sims, actions.edge + 1]], 1)
    middle = pair.mean(1, keepdims=True)
    cos, sin = np.cos(share * actions.turn)[:, None], np.sin(share * actions.turn)[:, None]
    arm = pair - middle
    turned = np.stack(
        [cos * arm[..., 0] - sin * arm[..., 1], sin * arm[..., 0] + cos * arm[..., 1]], -1
    )
    return np.asarray(middle + turned + share * actions.shift[:, None])


def straight(length: FloatArray, nodes: int) -> FloatArray:
    """(B, n, 2) states along x, centered."""
    x = (np.arange(nodes) / (nodes - 1) - 0.5) * length[:, None]
    return np.stack([x, np.zeros_like(x)], -1)
