"""The learned model of a DLO: states and actions in meters in the world to next states and their
derivatives.

Symbols: B pairs of state and action, n nodes. ``move`` is (B, 3): dx, dy m in the state's frame,
dtheta rad; ``rope`` is (3,) or (B, 3): mass kg, k_b, k_d.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from models.manipulation.frames import FloatArray, Frames, IntArray, frames
from models.manipulation.scaling import MOVE_SCALE, scale_move, scale_rope
from models.manipulation.simulator import BENDING, DAMPING

NODES = 16
"""Of a state that the networks take."""


class NetworkLike(Protocol):
    """Arrays in, arrays out; as ``models.weights.inference.Network``."""

    def run(self, *inputs: NDArray) -> tuple[NDArray, ...]: ...


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The exported networks ``dynamics``, ``dynamics_by_move`` and ``dynamics_by_rope``."""

    value: NetworkLike
    with_move: NetworkLike
    with_rope: NetworkLike

    def predict(
        self, states: FloatArray, edges: IntArray, moves: FloatArray, rope: FloatArray
    ) -> FloatArray:
        """Next states (B, n, 2)."""
        placed, inputs = _inputs(states, edges, moves, rope)
        return placed.to_world(self.value.run(*inputs)[0].astype(np.float64))

    def by_move(
        self, states: FloatArray, edges: IntArray, moves: FloatArray, rope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Next states, and their derivatives by dx, dy and dtheta, (B, n, 2, 3)."""
        placed, inputs = _inputs(states, edges, moves, rope)
        local, jacobian = self.with_move.run(*inputs)
        jacobian = jacobian.astype(np.float64) / MOVE_SCALE
        # The network's dx, dy are those of its frame.
        jacobian[..., :2] = np.einsum("bnik,bkj->bnij", jacobian[..., :2], placed.axes)
        return placed.to_world(local.astype(np.float64)), placed.jacobian_to_world(jacobian)

    def by_rope(
        self, states: FloatArray, edges: IntArray, moves: FloatArray, rope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Next states, and their derivatives by k_b and k_d, (B, n, 2, 2)."""
        placed, inputs = _inputs(states, edges, moves, rope)
        local, jacobian = self.with_rope.run(*inputs)
        jacobian = jacobian.astype(np.float64) / np.array([np.ptp(BENDING), np.ptp(DAMPING)])
        return placed.to_world(local.astype(np.float64)), placed.jacobian_to_world(jacobian)


def _inputs(
    states: FloatArray, edges: IntArray, moves: FloatArray, rope: FloatArray
) -> tuple[Frames, tuple[NDArray[np.float32], ...]]:
    batch, nodes = states.shape[:2]
    placed = frames("edge", states, edges)
    one_hot = np.eye(nodes - 1, dtype=np.float32)[placed.edges_to_frame(edges, nodes)]
    local_move = np.column_stack([placed.vectors_to_frame(moves[:, :2]), moves[:, 2]])
    ropes = np.broadcast_to(scale_rope(np.asarray(rope, np.float64)), (batch, 3))
    columns = (placed.to_frame(states), one_hot, scale_move(local_move), ropes)
    return placed, tuple(np.ascontiguousarray(c, np.float32) for c in columns)


def shape_distance(states: FloatArray, target: FloatArray) -> FloatArray:
    """Eq. 5.6 divided by n: the mean distance of corresponding nodes, (…,) m."""
    return np.asarray(np.hypot(*np.moveaxis(states - target, -1, 0)).mean(-1))
