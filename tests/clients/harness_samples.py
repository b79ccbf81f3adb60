"""A disentangling job as the service would answer: two sections from a branch-point, one crossed by
a third."""

from __future__ import annotations

from dlo_client.contracts import AnyJob, JobState
from dlo_client.contracts.disentangling import DisentangleResult
from dlo_client.contracts.topology import TopologyResult

from tests.clients import samples

WIDTH, HEIGHT = samples.WIDTH, samples.HEIGHT


def _section(
    number: int, points: list[tuple[float, float]], ends: tuple[str, str], branch: int | None
) -> dict:
    return {
        "id": number,
        "points_xy": points,
        "width_px": 6.0,
        "length_px": 80.0,
        "end_widths_px": (6.0, 6.0),
        "ends": ends,
        "branch_points": (branch, None),
        "closed": False,
        "score": 0.9,
        "name": None,
    }


def topology() -> TopologyResult:
    middle, right, low = (
        (WIDTH / 2, HEIGHT / 2),
        (WIDTH - 10.0, HEIGHT / 2),
        (WIDTH / 2, HEIGHT - 8.0),
    )
    place = {"section": 1, "u": 0.5}
    return TopologyResult.model_validate(
        {
            "width": WIDTH,
            "height": HEIGHT,
            "status": "branched",
            "message": "one branch-point, one crossing",
            "threshold": 0.5,
            "nodes_xy": [middle, right, low],
            "node_angles_rad": [0.0, 0.0, 1.5],
            "node_branch_scores": [0.9, 0.1, 0.0],
            "node_crossing_scores": [0.1, 0.8, 0.0],
            "edges": [{"a": 0, "b": 1, "score": 0.9}, {"a": 0, "b": 2, "score": 0.4}],
            "sections": [
                _section(1, [middle, right], ("branch", "free"), 1),
                _section(2, [middle, low], ("branch", "border"), 1),
                _section(3, [(10.0, HEIGHT / 2), middle], ("free", "branch"), None),
            ],
            "branch_points": [{"id": 1, "xy": middle, "sections": [1, 2, 3], "score": 0.97}],
            "crossings": [
                {
                    "id": 1,
                    "xy": (WIDTH * 0.75, HEIGHT / 2),
                    "over": place,
                    "under": {"section": 2, "u": 0.4},
                    "score": 0.88,
                    "order_score": 0.7,
                }
            ],
            "models": [],
        }
    )


def job() -> AnyJob:
    seen = topology()
    grip = {"xy": (WIDTH * 0.6, HEIGHT * 0.5), "angle_rad": 0.0, "arm": "left"}
    action = {
        "rank": 1,
        "crossing": 1,
        "section": 2,
        "about_branch_point": 1,
        "hold": grip,
        "pick": grip | {"xy": (WIDTH * 0.5, HEIGHT * 0.8)},
        "place": grip | {"xy": (WIDTH * 0.2, HEIGHT * 0.8)},
        "trajectory_xy": [(WIDTH * 0.5, HEIGHT * 0.8), (WIDTH * 0.2, HEIGHT * 0.8)],
        "turn_rad": 0.5,
        "crossings_before": 1,
        "crossings_after": 0,
        "passes_over": [],
        "clearance_px": 12.0,
        "score": 0.8,
        "why": "the free end swings clear",
    }
    result = DisentangleResult.model_validate(
        {
            "width": WIDTH,
            "height": HEIGHT,
            "status": "planned",
            "message": "one action",
            "actions": [action],
            "topology": seen.model_dump(),
            "models": [],
        }
    )
    return samples.job(JobState.SUCCEEDED, kind="plan_disentangle", result=result)
