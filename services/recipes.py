"""A recipe, a camera and the poses of the flange to the JSON of a request.

Strategy: the recipe's request is a set of fields. The camera fills what these leave out: intrinsics
and pose of every view, or of the picture; the output's camera, plane and tool. The pose of a camera
on the arm is that of the flange, which comes with the run, times ``T_flange_camera``. The whole
then is an ordinary request, checked like any other.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast, get_args

import numpy as np
from dlo_client.contracts import AnyRequest, FieldProblem
from dlo_client.contracts.cameras import Pose
from dlo_client.contracts.frames import OutputFrame
from dlo_client.contracts.recipes import CameraBody, FlangePose, Recipe, RecipeBody, StoredCamera
from pydantic import ValidationError

from services.fields import body_problems
from services.problems import ProblemError, field_error, fields_error
from workers import rotations
from workers.kept import Kept
from workers.record import REQUEST, pictures

_FIELDS = {
    str(request.model_fields["kind"].default): set(request.model_fields)
    for request in get_args(get_args(AnyRequest)[0])
}
"""Names of the fields of a request, by its kind."""

_TRIAL_STEP_M = 0.1
"""Between the flange poses that a recipe is tried with when it is stored."""


@dataclass(frozen=True)
class Composer:
    """Makes requests of one recipe; ``camera`` is the one that it names."""

    request: dict[str, Any]
    output: OutputFrame | None
    camera: CameraBody | None

    def compose(self, images: int, flange: Sequence[FlangePose]) -> bytes:
        """The JSON of a request for so many pictures. Raises ProblemError."""
        return json.dumps(self._fields(images, flange)).encode()

    def check(self) -> list[str]:
        """Compose once with stand-ins for pictures; raises ProblemError naming the fields below
        ``request``.

        Returns the ids of the pictures that the request names itself.
        """
        views = self.request.get("views")
        images = len(views) if isinstance(views, list) else 2
        fields = self._fields(
            images, [self._trial_pose(k) for k in range(images)] if self._on_arm else []
        )
        try:
            return pictures(REQUEST.validate_python(fields))
        except ValidationError as error:
            found = error.errors(include_url=False, include_input=False)
            problems = [
                FieldProblem(
                    field=p.field if p.field.startswith("output") else f"request.{p.field}",
                    message=p.message,
                )
                for p in body_problems(found, fields, whole="kind")
            ]
            raise fields_error(problems, len(problems)) from None

    @property
    def has_views(self) -> bool:
        """Whether one request takes several pictures."""
        return "views" in _fields_of(self.request.get("kind"))

    @property
    def _on_arm(self) -> bool:
        return self.camera is not None and self.camera.T_flange_camera is not None

    def _fields(self, images: int, flange: Sequence[FlangePose]) -> dict[str, Any]:
        fields: dict[str, Any] = json.loads(json.dumps(self.request))
        poses = self._poses(flange)
        if self.has_views:
            self._fill_views(fields, images, poses)
        elif self.camera is not None:
            self._fill_picture(fields, poses)
        if self.output is not None:
            fields["output"] = self._output(poses)
        return fields

    def _poses(self, flange: Sequence[FlangePose]) -> list[Pose]:
        """``T_world_camera`` for each pose of the flange; of a camera that stands still the one
        that it has."""
        if self.camera is None or self.camera.T_flange_camera is None:
            if flange:
                raise field_error(
                    "flange", "has no meaning: the recipe's camera is not on the flange"
                )
            fixed = self.camera.T_world_camera if self.camera else None
            return [] if fixed is None else [fixed]
        unit = self.output.unit if self.output else "m"
        convention = self.output.rotation if self.output else "quaternion_xyzw"
        poses = []
        for index, numbers in enumerate(flange):
            try:
                on_world = rotations.pose_of(numbers, unit, convention)
            except ValueError as error:
                raise field_error(f"flange.{index}", str(error)) from None
            poses.append(_rows(on_world @ np.array(self.camera.T_flange_camera)))
        return poses

    def _fill_views(self, fields: dict[str, Any], images: int, poses: Sequence[Pose]) -> None:
        views = fields.setdefault("views", [{} for _ in range(images)])
        if self.camera is None or not isinstance(views, list):
            return
        if self._on_arm and len(poses) != len(views):
            message = f"{len(views)} pictures need as many poses of the flange, not {len(poses)}"
            raise field_error("flange", message)
        for index, view in enumerate(view for view in views if isinstance(view, dict)):
            view.setdefault("intrinsics", self._intrinsics())
            if poses:
                view.setdefault("T_world_camera", poses[index if self._on_arm else 0])

    def _fill_picture(self, fields: dict[str, Any], poses: Sequence[Pose]) -> None:
        """For the kinds that take the camera of their one picture, which depth is measured with."""
        known = _fields_of(fields.get("kind"))
        if "intrinsics" in known:
            fields.setdefault("intrinsics", self._intrinsics())
        if "T_world_camera" in known and poses:
            fields.setdefault("T_world_camera", poses[0])

    def _output(self, poses: Sequence[Pose]) -> dict[str, Any]:
        assert self.output is not None
        output = self.output.model_dump(mode="json", exclude_none=True)
        if self.camera is not None:
            output["plane"] = self.camera.plane.model_dump(mode="json")
            if self.camera.T_flange_tool is not None:
                output["T_flange_tool"] = self.camera.T_flange_tool
            if poses:
                output["camera"] = {"intrinsics": self._intrinsics(), "T_world_camera": poses[0]}
        return output

    def _intrinsics(self) -> dict[str, Any]:
        assert self.camera is not None
        return self.camera.intrinsics.model_dump(mode="json", exclude_none=True)

    def _trial_pose(self, index: int) -> FlangePose:
        convention = self.output.rotation if self.output else "quaternion_xyzw"
        return [_TRIAL_STEP_M * index, 0.0, 0.0, *rotations.written(np.eye(3), convention)]


def recipe_of(number: int, kept: Kept) -> Recipe:
    """A stored text as it is answered."""
    return Recipe.model_validate(
        json.loads(kept.text) | {"number": number, "version": kept.version}
    )


def camera_of(kept: Kept) -> StoredCamera:
    """A stored text as it is answered."""
    return StoredCamera.model_validate(
        json.loads(kept.text) | {"name": kept.name, "version": kept.version}
    )


def composer(recipe: Recipe | RecipeBody, camera: StoredCamera | None) -> Composer:
    """For runs of ``recipe``."""
    return Composer(recipe.request, recipe.output, camera.camera if camera else None)


def unknown(what: str, name: object) -> ProblemError:
    """404 for a recipe or a camera."""
    return ProblemError(404, f"unknown_{what}", f"there is no {what} {name!s:.100} of this version")


def _fields_of(kind: object) -> set[str]:
    """Names of the fields of a kind's request; none for what is no kind."""
    return _FIELDS.get(kind, set()) if isinstance(kind, str) else set()


def _rows(pose: Any) -> Pose:
    return cast(Pose, tuple(tuple(row) for row in pose.tolist()))
