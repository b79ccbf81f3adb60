"""What a robot should do: shape a DLO on a table, or disentangle a harness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from models.disentangling import plan as disentangling
from models.disentangling.evidence import MOVE_FEATURES
from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths
from models.library import arguments, loading
from models.library.arguments import ArgumentError
from models.manipulation import planning
from models.manipulation.actions import Candidates
from models.manipulation.belief import Belief
from models.manipulation.dynamics import Dynamics
from models.manipulation.limits import Limits, checks
from models.manipulation.parameters import MID_RANGE, Estimate, History, estimate
from models.manipulation.resampling import (
    back_to_points,
    edge_of_points,
    node_edge_of,
    node_edges_within,
    to_nodes,
)
from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.simulator import BENDING, DAMPING, LENGTH_M, MASS_KG
from models.topology.scene import Topology

_DYNAMICS = ("dynamics", "dynamics_by_move", "dynamics_by_rope")
_MOST_HORIZON = 4


@dataclass(frozen=True, eq=False)
class ShapeAction:
    """Grip the middle of ``edge`` (between points ``edge`` and ``edge + 1`` of the state) and move
    it by ``move``: dx, dy m and dtheta rad. ``predicted_m`` ``(n, 2)``: the points after it;
    ``error_m``: their mean distance to the target; ``error_at_end_m``: that at the end of the
    sequence of actions; ``keeps``: each limit, and whether it is kept."""

    edge: int
    move: FloatArray
    predicted_m: FloatArray
    error_m: float
    error_at_end_m: float
    keeps: dict[str, bool]


def plan_shape(
    state_m: ArrayLike,
    target_m: ArrayLike,
    *,
    mass_kg: float,
    k_b: float = MID_RANGE[0],
    k_d: float = MID_RANGE[1],
    limits: Limits | None = None,
    horizon: int = planning.USUAL_HORIZON,
    at_most: int = 5,
) -> list[ShapeAction]:
    """Pick-and-place actions that bring a DLO on a table closest to a target shape (thesis chapter
    5), best first.

    ``state_m``, ``target_m``: ``(n, 2)`` and ``(m, 2)`` points along the DLO, meters. ``mass_kg``
    of the whole DLO; ``k_b`` bending stiffness and ``k_d`` damping of the model
    (:func:`estimate_parameters`). ``limits``: lengths in meters, edges those of the state.
    ``horizon``: actions looked ahead where one brings little. ``at_most``: actions returned; none
    where every action breaks a limit.

    Raises ArgumentError.
    """
    points, target = (
        arguments.points(state_m, "state_m", 2),
        arguments.points(target_m, "target_m", 2),
    )
    if horizon not in range(1, _MOST_HORIZON + 1):
        raise ArgumentError(
            "horizon", f"is {horizon!r}; 1 to {_MOST_HORIZON} actions can be looked ahead"
        )
    mass = arguments.number(mass_kg, "mass_kg", *MASS_KG)
    rope = np.array(
        [mass, arguments.number(k_b, "k_b", *BENDING), arguments.number(k_d, "k_d", *DAMPING)]
    )
    scale = _scale(points)
    state, wanted = to_nodes(points) * scale, to_nodes(target) * scale
    kept = _scaled(limits or Limits(), points, scale)
    found, ends = planning.plan(Belief.certain(_dynamics(), rope), state, wanted, kept, horizon)
    return [
        _action(points, state, found, float(ends[k]), k, scale, kept)
        for k in range(min(len(ends), at_most))
    ]


def estimate_parameters(
    before_m: Sequence[ArrayLike],
    after_m: Sequence[ArrayLike],
    edges: Sequence[int],
    moves: ArrayLike,
    *,
    mass_kg: float,
) -> Estimate:
    """Bending stiffness and damping of a DLO from M actions and what they did (thesis 5.5.2).

    ``before_m``, ``after_m``: M states ``(n, 2)`` m; ``edges``: the edge of each ``before_m`` that
    was gripped; ``moves``: ``(M, 3)`` dx, dy m and dtheta rad. ``mass_kg`` of the whole DLO.

    Raises ArgumentError.
    """
    mass = arguments.number(mass_kg, "mass_kg", *MASS_KG)
    befores = [arguments.points(b, f"before_m[{k}]", 2) for k, b in enumerate(before_m)]
    afters = [arguments.points(a, f"after_m[{k}]", 2) for k, a in enumerate(after_m)]
    moved = np.asarray(moves, np.float64)
    if (
        not befores
        or not len(befores) == len(afters) == len(edges) == len(moved)
        or moved.shape[1:] != (3,)
    ):
        counts = f"{len(befores)} before_m, {len(afters)} after_m, {len(edges)} edges and {moved.shape} moves"
        raise ArgumentError("moves", f"are (M, 3), one a state, but there are {counts}")
    if not np.isfinite(moved).all():
        raise ArgumentError("moves", "has values that are NaN or infinite")
    for k, (edge, points) in enumerate(zip(edges, befores, strict=True)):
        if not 0 <= edge < len(points) - 1:
            raise ArgumentError(
                f"edges[{k}]", f"is {edge}; the state has edges 0 to {len(points) - 2}"
            )
    scale = _scale(befores[0])
    history = History(
        np.stack([to_nodes(b) for b in befores]) * scale,
        np.array([node_edge_of(b, e) for b, e in zip(befores, edges, strict=True)], np.int64),
        moved * np.array([scale, scale, 1.0]),
        np.stack([to_nodes(a) for a in afters]) * scale,
    )
    found = estimate(_dynamics(), history, mass)
    return replace(
        found, error_m=found.error_m / scale, error_before_m=found.error_before_m / scale
    )


def plan_disentangle(
    topology: Topology, *, params: disentangling.DisentangleParams | None = None
) -> list[disentangling.Action]:
    """Ranked dual-arm actions that remove a crossing of a harness (thesis Algorithm 7); empty where
    there is none.

    ``topology``: of :func:`topology`; lengths in its pixels.

    Raises ArgumentError.
    """
    if not isinstance(topology, Topology):
        raise ArgumentError(
            "topology", f"is a {type(topology).__name__}; dlo.topology() gives a Topology"
        )
    return disentangling.plan(topology, loading.default("moves").weighing(MOVE_FEATURES), params)


def _dynamics() -> Dynamics:
    return Dynamics(*(loading.default(task) for task in _DYNAMICS))


def _scale(points: FloatArray) -> float:
    """From meters to a length that the network was trained for."""
    length = float(arc_lengths(points)[-1])
    return float(np.clip(length, *LENGTH_M)) / length


def _scaled(limits: Limits, points: FloatArray, scale: float) -> Limits:
    """In the network's lengths, and its edges."""
    return Limits(
        box=None if limits.box is None else np.asarray(limits.box, np.float64) * scale,
        zones=[np.asarray(zone, np.float64) * scale for zone in limits.zones],
        base=None if limits.base is None else np.asarray(limits.base, np.float64) * scale,
        reach=(limits.reach[0] * scale, limits.reach[1] * scale),
        shift=min(limits.shift * scale, float(MOVE_SCALE[0])),
        turn=min(limits.turn, float(MOVE_SCALE[2])),
        no_grasp=node_edges_within(points, list(limits.no_grasp)),
    )


def _action(
    points: FloatArray,
    state: FloatArray,
    found: Candidates,
    end: float,
    k: int,
    scale: float,
    limits: Limits,
) -> ShapeAction:
    return ShapeAction(
        edge=edge_of_points(points, int(found.edge[k])),
        move=found.move[k] / np.array([scale, scale, 1.0]),
        predicted_m=back_to_points(points, state / scale, found.predicted[k] / scale),
        error_m=float(found.error[k]) / scale,
        error_at_end_m=end / scale,
        keeps={check.name: bool(check.passed) for check in checks(state, found, k, limits)},
    )
