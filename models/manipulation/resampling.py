"""States of any number of points to the network's nodes, by arc length, and what is predicted back
to them."""

from __future__ import annotations

import numpy as np

from models.geometry.polylines import arc_lengths, resample
from models.manipulation.dynamics import NODES
from models.manipulation.frames import FloatArray


def to_nodes(points: FloatArray) -> FloatArray:
    """(N, 2) to (16, 2) at equal arc length."""
    return points if len(points) == NODES and _even(points) else resample(points, NODES)


def back_to_points(points: FloatArray, nodes: FloatArray, moved: FloatArray) -> FloatArray:
    """``points`` (N, 2) displaced as the ``nodes`` (16, 2) were to ``moved``, interpolated by arc
    length."""
    shares = arc_lengths(points)
    at = shares / shares[-1] * (len(nodes) - 1)
    shift = moved - nodes
    steps = np.arange(len(nodes))
    return points + np.stack([np.interp(at, steps, axis) for axis in shift.T], 1)


def edge_of_points(points: FloatArray, node_edge: int, nodes: int = NODES) -> int:
    """The edge between given points in which the middle of this edge between nodes is."""
    shares = arc_lengths(points) / arc_lengths(points)[-1]
    middle = (node_edge + 0.5) / (nodes - 1)
    return int(np.clip(np.searchsorted(shares, middle, "right") - 1, 0, len(points) - 2))


def node_edge_of(points: FloatArray, edge: int, nodes: int = NODES) -> int:
    """The edge between nodes in which the middle of this edge between given points is."""
    lengths = arc_lengths(points)
    middle = (lengths[edge] + lengths[edge + 1]) / 2 / lengths[-1]
    return int(np.clip(middle * (nodes - 1), 0, nodes - 2))


def node_edges_within(points: FloatArray, edges: list[int], nodes: int = NODES) -> list[int]:
    """The node edges whose middles lie on one of these edges between given points."""
    return [k for k in range(nodes - 1) if edge_of_points(points, k, nodes) in edges]


def _even(points: FloatArray) -> bool:
    steps = np.hypot(*np.diff(points, axis=0).T)
    return bool(np.ptp(steps) < 1e-3 * steps.mean())
