"""What ``plan_shape`` answers, from actions in nodes and in the network's scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import PlannedAction
from dlo_client.contracts.shape_plans import GripPose, PlanCheck, PlanCode, PlanStatus
from numpy.typing import NDArray

from models.manipulation.actions import Candidates
from models.manipulation.limits import Limits, checks, dense, inside
from models.manipulation.resampling import edge_of_points

FloatArray = NDArray[np.float64]
DECIMALS = 6


@dataclass(frozen=True)
class Problem:
    """State and target as given (N, 2) m, and as nodes in the network's scale."""

    points: FloatArray
    state: FloatArray
    target: FloatArray
    scale: float
    limits: Limits


def outside(problem: Problem) -> str | None:
    """Which limit the target itself breaks."""
    points, limits = dense(problem.target), problem.limits
    if limits.box is not None and not np.all((points >= limits.box[0]) & (points <= limits.box[1])):
        return "the target leaves limits.workspace_m"
    for k, zone in enumerate(limits.zones):
        if inside(points, zone).any():
            return f"the target enters limits.keep_out_m.{k}"
    return None


def proposal(
    problem: Problem,
    found: Candidates,
    k: int,
    at_end: float,
    probability: float | None,
    more: list[PlanCheck],
) -> PlannedAction:
    """Candidate ``k``; ``at_end``: the distance at the end of its sequence, in the scale of
    ``found.error``."""
    edge, move, scale = int(found.edge[k]), found.move[k], problem.scale
    pair = problem.state[edge : edge + 2] / scale
    shift = move[:2] / scale
    middle, angle = pair.mean(0), float(np.arctan2(*(pair[1] - pair[0])[::-1]))
    kept = [
        PlanCheck.model_validate({"name": c.name, "passed": c.passed})
        for c in checks(problem.state, found, k, problem.limits)
    ]
    return PlannedAction(
        edge=edge_of_points(problem.points, edge, len(problem.state)),
        dx_m=round(float(shift[0]), DECIMALS),
        dy_m=round(float(shift[1]), DECIMALS),
        dtheta_rad=round(float(move[2]), DECIMALS),
        pick=_grip(middle, angle),
        place=_grip(middle + shift, angle + float(move[2])),
        error_after_m=round(float(found.error[k]) / scale, DECIMALS),
        error_at_end_m=round(at_end / scale, DECIMALS),
        converged=bool(found.converged[k]),
        probability=None if probability is None else round(probability, 4),
        checks=[*kept, *more],
    )


def _grip(xy: FloatArray, angle: float) -> GripPose:
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    place = round(float(xy[0]), DECIMALS), round(float(xy[1]), DECIMALS)
    return GripPose(xy_m=place, angle_rad=round(wrapped, DECIMALS))


def rounded(points: FloatArray) -> list[tuple[float, float]]:
    return [(x, y) for x, y in np.round(points, DECIMALS).tolist()]


def status(code: PlanCode, message: str) -> dict[str, object]:
    return {"status": PlanStatus(code=code, message=message)}
