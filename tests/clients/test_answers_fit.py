"""An answer's own objects are accepted wherever a request asks for such a thing, as JSON and as the
SDK's objects."""

from __future__ import annotations

import typing
from typing import Any, get_args

import pytest
from dlo_client.contracts import (
    AnyRequest,
    AnyResult,
    CameraView,
    Contract,
    Curve3D,
    DisentangleAction,
    DisentangleRequest,
    Experience,
    ImageInfo,
    InstancesRequest,
    MergeCurvesRequest,
    MoveAction,
    NextViewRequest,
    PlannedAction,
    PlanShapeRequest,
    ReconstructRequest,
    RopeParameters,
    TopologyResult,
    TrackedLabels,
    ViewOutcome,
)
from dlo_client.contracts.base import Reply
from dlo_client.contracts.manipulation import EstimateParametersResult
from dlo_client.contracts.shape_plans import UsedParameters
from pydantic import BaseModel

LINE = [(0.02 * k, 0.0) for k in range(10)]
POSE = ((1.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.4), (0.0, 0.0, 0.0, 1.0))
INTRINSICS = {"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240}
GRIP = {"xy_m": [0, 0], "angle_rad": 0}
ACTION = {
    "edge": 3,
    "dx_m": 0.05,
    "dy_m": 0.01,
    "dtheta_rad": 0.3,
    "pick": GRIP,
    "place": GRIP,
    "error_after_m": 0.01,
    "error_at_end_m": 0.01,
    "converged": True,
    "checks": [{"name": "displacement", "passed": True}],
}
CURVE = {
    "points_m": [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]],
    "covariance_m2": [[1e-6, 0, 0, 1e-6, 0, 1e-6]] * 3,
    "sigma_m": [1e-3] * 3,
    "length_m": 0.2,
    "spline": {
        "degree": 3,
        "knots": [0] * 4 + [1] * 4,
        "control_m": [[0.06 * k, 0, 0] for k in range(4)],
    },
}
SECTION = {
    "id": 1,
    "points_xy": [[5, 5], [90, 60]],
    "width_px": 4,
    "length_px": 100,
    "end_widths_px": [4, 4],
    "ends": ["free", "free"],
    "branch_points": [None, None],
    "closed": False,
    "score": 1,
    "name": "trunk",
}
HELD = {"xy": [5, 5], "angle_rad": 0.1}
TURN = {
    "rank": 1,
    "crossing": 1,
    "section": 1,
    "about_branch_point": None,
    "hold": HELD,
    "pick": HELD,
    "place": HELD,
    "trajectory_xy": [[5, 5]],
    "turn_rad": 0.4,
    "crossings_before": 1,
    "crossings_after": 0,
    "passes_over": [],
    "clearance_px": 9,
    "score": 0.8,
    "why": "it parts them",
}
ANSWERS: dict[str, Reply] = {
    "turn": DisentangleAction.model_validate(TURN),
    "action": PlannedAction.model_validate(ACTION),
    "used": UsedParameters(k_b=0.4, k_d=12.0, sigma=(0.1, 0.2), source="history"),
    "estimated": EstimateParametersResult(
        k_b=0.4,
        k_d=12.0,
        sigma=(0.1, 0.2),
        ratio_sigma=0.1,
        loss_m=0.0,
        loss_mid_range_m=0.0,
        sample_errors_m=[],
        warnings=[],
        models=[],
    ),
    "view": ViewOutcome.model_validate(
        {
            "name": "left",
            "status": "used",
            "instances_found": 1,
            "share": 1,
            "intrinsics": INTRINSICS,
            "T_world_camera": POSE,
        }
    ),
    "labels": TrackedLabels.model_validate(
        {
            "name": "left",
            "width": 640,
            "height": 480,
            "instances": [],
            "crossings": [],
            "moved_px": 0,
            "intrinsics": INTRINSICS,
            "T_world_camera": POSE,
        }
    ),
    "curve": Curve3D.model_validate(CURVE),
    "topology": TopologyResult.model_validate(
        {
            "width": 96,
            "height": 72,
            "status": "plain",
            "message": "",
            "threshold": 0.5,
            "nodes_xy": [],
            "node_angles_rad": [],
            "node_branch_scores": [],
            "node_crossing_scores": [],
            "edges": [],
            "sections": [SECTION],
            "branch_points": [],
            "crossings": [],
            "models": [],
        }
    ),
    "upload": ImageInfo(id="0" * 64, sha256="0" * 64, width=640, height=480, bytes=1000),
}
SHAPE = {"state_m": LINE, "target_m": LINE, "object": {"mass_kg": 0.05}}
AWAY = ((*POSE[0][:3], 0.05), *POSE[1:])


def _history(action: Any) -> Contract:
    return PlanShapeRequest.model_validate(
        SHAPE | {"history": [{"before": LINE, "action": action, "after": LINE}]}
    )


def _attempt(action: Any) -> Contract:
    return DisentangleRequest.model_validate({"attempts": [{"action": action, "crossings": 0}]})


PLACES = {
    "turn": [_attempt],
    "action": [lambda a: _history(a), lambda a: Experience(before=LINE, action=a, after=LINE)],
    "used": [lambda a: PlanShapeRequest.model_validate(SHAPE | {"parameters": a})],
    "estimated": [lambda a: PlanShapeRequest.model_validate(SHAPE | {"parameters": a})],
    "view": [
        lambda a: NextViewRequest(curve=CURVE, cameras=[a]),
        lambda a: ReconstructRequest(views=[a, {"intrinsics": INTRINSICS, "T_world_camera": AWAY}]),
    ],
    "labels": [lambda a: NextViewRequest(curve=CURVE, cameras=[a])],
    "curve": [
        lambda a: NextViewRequest(
            curve=a, cameras=[{"intrinsics": INTRINSICS, "T_world_camera": POSE}]
        ),
        lambda a: MergeCurvesRequest(curves=[a, a]),
    ],
    "topology": [lambda a: DisentangleRequest(topology=a)],
    "upload": [lambda a: InstancesRequest(image=a), lambda a: InstancesRequest(mask=a)],
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answers_object_is_taken(name):
    """The action that ``plan_shape`` answers was refused in ``history``: unknown fields."""
    for request in PLACES[name]:
        assert request(ANSWERS[name].model_dump(mode="json")) == request(ANSWERS[name])


def _models(annotation: Any, found: dict[type, None]) -> dict[type, None]:
    """Every contract that a type is made of."""
    if (
        isinstance(annotation, type)
        and issubclass(annotation, BaseModel)
        and annotation not in found
    ):
        found[annotation] = None
        for field in annotation.model_fields.values():
            _models(field.annotation, found)
    for inner in get_args(annotation):
        _models(inner, found)
    return found


def test_there_is_no_other_pair():
    """Walks all types: whatever an answer holds that has all the fields of a part of a request fits
    there, and it is named in ANSWERS, unless both are of one type."""
    asked = _models(AnyRequest, {})
    answered = {*_models(AnyResult, {}), ImageInfo} - {r for r in asked if not issubclass(r, Reply)}
    pairs = {
        (answer, part)
        for answer in answered
        for part in asked
        if answer is not part
        and issubclass(answer, Reply)
        and not hasattr(part, "needs_picture")
        and (need := {n for n, f in part.model_fields.items() if f.is_required()})
        and need <= set(answer.model_fields)
        and all(
            _same(answer.model_fields[n].annotation, part.model_fields[n].annotation) for n in need
        )
    }
    assert {
        (PlannedAction, MoveAction),
        (UsedParameters, RopeParameters),
        (ViewOutcome, CameraView),
    } <= pairs
    for answer, part in pairs:
        over = set(answer.model_fields) - set(part.model_fields)
        assert not over or part.model_config["extra"] == "ignore", (
            f"{answer.__name__} has more than {part.__name__}"
        )
        assert part.model_config.get("from_attributes") or issubclass(part, Reply), part.__name__
        assert any(type(sample) is answer for sample in ANSWERS.values()), (
            f"no sample of {answer.__name__}"
        )


def _same(a: Any, b: Any) -> bool:
    """Whether two annotations are of one kind, whatever their limits."""
    return _plain(a) == _plain(b)


def _plain(annotation: Any) -> Any:
    origin, inner = typing.get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        return _plain(inner[0])
    return (origin, tuple(map(_plain, inner))) if origin else annotation
