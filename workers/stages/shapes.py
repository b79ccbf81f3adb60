"""What the planner's stages share: points of any number to nodes of the trained size, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import Experience, ModelUsed
from dlo_client.contracts.manipulation import DloObject
from dlo_client.contracts.shape_plans import PlanWarning
from numpy.typing import NDArray

from models.geometry.polylines import arc_lengths, crossing_segments
from models.manipulation.dynamics import Dynamics
from models.manipulation.parameters import History
from models.manipulation.resampling import node_edge_of, to_nodes
from models.manipulation.simulator import LENGTH_M, MASS_KG
from models.weights.inference import default_name
from workers.stages.encoding import model_used
from workers.stages.outcome import InvalidInput, Tools

FloatArray = NDArray[np.float64]
NETWORKS = ("dynamics", "dynamics_by_move", "dynamics_by_rope")


def learned(tools: Tools) -> tuple[Dynamics, list[ModelUsed]]:
    """The model of a DLO, and its networks for the answer."""
    loaded = [tools.network(default_name(task)) for task in NETWORKS]
    return Dynamics(*loaded), [model_used(network.spec) for network in loaded]


@dataclass(frozen=True)
class Rope:
    """``scale`` from the client's meters to a length that the network knows, ``mass`` kg within its
    range."""

    scale: float
    mass: float
    warnings: list[PlanWarning]


def rope_of(object_: DloObject, length_m: float) -> Rope:
    """A DLO beyond the trained range is planned for as one at its edge, scaled; said in a
    warning."""
    warnings = []
    mass = float(np.clip(object_.mass_kg, *MASS_KG))
    if mass != object_.mass_kg:
        text = f"{object_.mass_kg:g} kg is outside the trained {MASS_KG[0]} to {MASS_KG[1]} kg: taken as {mass:g}"
        warnings.append(PlanWarning(code="mass_untrained", field="object.mass_kg", message=text))
    length = object_.length_m or length_m
    scale = float(np.clip(length, *LENGTH_M)) / length
    if scale != 1.0:
        text = (
            f"{length:.3g} m is outside the trained {LENGTH_M[0]} to {LENGTH_M[1]} m: planned as a DLO of "
            f"{length * scale:.3g} m, scaled; k_b and k_d are those of that one"
        )
        warnings.append(PlanWarning(code="length_untrained", field="object.length_m", message=text))
    return Rope(scale, mass, warnings)


def length_of(points: FloatArray) -> float:
    return float(arc_lengths(points)[-1])


def crosses_itself(points: FloatArray) -> bool:
    return len(crossing_segments(points[:-1], points[1:]).xy) > 0


def check_edges(history: Sequence[Experience]) -> None:
    """Every action of the history names an edge that there is. Raises InvalidInput naming the
    item."""
    for k, item in enumerate(history):
        if item.action.edge > len(item.before) - 2:
            text = f"{len(item.before)} points have edges 0 to {len(item.before) - 2}"
            raise InvalidInput(f"history.{k}.action.edge", text, "invalid_history")


def history_of(items: Sequence[Experience], scale: float) -> History:
    """Everything in nodes of the trained size."""
    before, after, edges, moves = [], [], [], []
    for item in items:
        points = np.array(item.before)
        nodes = to_nodes(points)
        moved = to_nodes(np.array(item.after))
        before.append(nodes * scale)
        after.append(moved * scale)
        edges.append(node_edge_of(points, item.action.edge))
        moves.append([item.action.dx_m * scale, item.action.dy_m * scale, item.action.dtheta_rad])
    return History(
        np.array(before).reshape(-1, 16, 2),
        np.array(edges, np.int64),
        np.array(moves).reshape(-1, 3),
        np.array(after).reshape(-1, 16, 2),
    )


def contradictions(errors_m: FloatArray, moved_m: FloatArray, items: int) -> list[PlanWarning]:
    """Of the last of so many items of the history those that no parameters explain: more than half
    of the motion is left, and over 15 mm."""
    first = items - len(errors_m)
    odd = np.flatnonzero((errors_m > 0.5 * moved_m) & (errors_m > 0.015))
    text = "no k_b and k_d explain this item: {:.0f} mm a point are left"
    return [
        PlanWarning(
            code="history_contradicts",
            field=f"history.{first + k}",
            message=text.format(1e3 * errors_m[k]),
        )
        for k in odd.tolist()
    ]
