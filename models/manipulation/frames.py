"""Frames in which networks see states and actions (thesis 5.4.2): moved, turned and renumbered,
never mirrored.

Two kinds. ``principal``, the thesis's: the origin is the mean of the nodes, x their first principal
axis, nodes run from negative to positive x. ``edge``, ours: the origin is the middle of the gripped
edge, x its direction, and nodes are renumbered so that the edge is in the first half. There what
the gripper does is the same picture for every place of the DLO on the table, and for both
directions of counting.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
FrameKind = Literal["principal", "edge"]


@dataclass(frozen=True, eq=False)
class Frames:
    """``origin`` (B, 2) m; ``axes`` (B, 2, 2), rows are the frame's x and y in the world,
    determinant 1; ``reversed`` (B,) whether nodes are counted from the other end."""

    origin: FloatArray
    axes: FloatArray
    reversed: NDArray[np.bool_]

    def to_frame(self, states: FloatArray) -> FloatArray:
        """(B, n, 2) world to frame, renumbered."""
        local = np.einsum("bij,bnj->bni", self.axes, states - self.origin[:, None])
        return np.where(self.reversed[:, None, None], local[:, ::-1], local)

    def to_world(self, local: FloatArray) -> FloatArray:
        """The inverse of :meth:`to_frame`."""
        ordered = np.where(self.reversed[:, None, None], local[:, ::-1], local)
        return np.einsum("bji,bnj->bni", self.axes, ordered) + self.origin[:, None]

    def vectors_to_frame(self, vectors: FloatArray) -> FloatArray:
        """(B, 2) displacements; angles are the same in both."""
        return np.einsum("bij,bj->bi", self.axes, vectors)

    def edges_to_frame(self, edges: IntArray, nodes: int) -> IntArray:
        """(B,) edge numbers, counted as the nodes are."""
        return np.where(self.reversed, nodes - 2 - edges, edges)

    def jacobian_to_world(self, jacobian: FloatArray) -> FloatArray:
        """(B, n, 2, k) derivatives of frame points to those of world points."""
        ordered = np.where(self.reversed[:, None, None, None], jacobian[:, ::-1], jacobian)
        return np.einsum("bji,bnjk->bnik", self.axes, ordered)


def frames(kind: FrameKind, states: FloatArray, edges: IntArray) -> Frames:
    """Frames of B states (B, n, 2) and gripped ``edges`` (B,)."""
    return _edge_frames(states, edges) if kind == "edge" else _principal_frames(states)


def _edge_frames(states: FloatArray, edges: IntArray) -> Frames:
    sims, nodes = np.arange(len(states)), states.shape[1]
    first, second = states[sims, edges], states[sims, edges + 1]
    turned_round = edges > (nodes - 2) / 2
    direction = np.where(turned_round[:, None], first - second, second - first)
    return Frames((first + second) / 2, _axes(direction), turned_round)


def _principal_frames(states: FloatArray) -> Frames:
    origin = states.mean(1)
    away = states - origin[:, None]
    spread = np.einsum("bni,bnj->bij", away, away)
    axis = np.linalg.eigh(spread)[1][..., -1]
    # One of the two directions of the axis, always the same: otherwise equal states would have two
    # pictures.
    axis = np.where((axis[:, :1] < 0) | ((axis[:, :1] == 0) & (axis[:, 1:] < 0)), -axis, axis)
    along = np.einsum("bni,bi->bn", away, axis)
    return Frames(origin, _axes(axis), along[:, -1] < along[:, 0])


def _axes(direction: FloatArray) -> FloatArray:
    x = direction / np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-12)[:, None]
    return np.stack([x, np.stack([-x[:, 1], x[:, 0]], -1)], 1)
