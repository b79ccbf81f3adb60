"""A recipe of a job: its request without pictures, which become the samples that the recipe is
tried with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dlo_client.contracts import AnyJob, AnyRequest, CameraView, ImageRef
from dlo_client.contracts.frames import Output, OutputFrame
from dlo_client.contracts.recipes import CameraBody, Recipe, RecipeBody, Sample, StoredCamera

from services.problems import ProblemError

_OF_ONE_JOB = (
    "image",
    "mask",
    "depth",
    "previous",
    "time_s",
    "label",
    "webhook_url",
    "default_model",
    "output",
)
"""Fields that say nothing of the next job."""

_LONGEST_NAME = 100


def recipe_of_job(job: AnyJob, request: AnyRequest, cameras: Sequence[StoredCamera]) -> RecipeBody:
    """A recipe that repeats ``job`` on other pictures. Of its fields those stay that are not the
    default; an output's camera becomes the one of ``cameras`` with the same calibration. Raises
    ProblemError for a kind without pictures."""
    fields = request.model_dump(mode="json", exclude_defaults=True)
    if not {"image", "views"} & set(type(request).model_fields):
        raise ProblemError(
            409,
            "no_pictures",
            f"{job.kind} takes no pictures: there is nothing for a recipe to repeat",
        )
    for name in _OF_ONE_JOB:
        fields.pop(name, None)
    for view in fields.get("views", []):
        view.pop("image", None)
    output = request.output
    return RecipeBody(
        name=(job.label or job.kind)[:_LONGEST_NAME],
        request={
            "kind": job.kind,
            **{name: value for name, value in fields.items() if value != {}},
        },
        camera=_camera_of(output, cameras) if output else None,
        output=OutputFrame(**{name: getattr(output, name) for name in OutputFrame.model_fields})
        if output
        else None,
        samples=_samples(request),
    )


def body_of(recipe: Recipe) -> RecipeBody:
    """What a stored recipe is made of."""
    return RecipeBody(**{name: getattr(recipe, name) for name in RecipeBody.model_fields})


def _samples(request: AnyRequest) -> list[Sample]:
    """None where the request had more than pictures: without its mask or depth it would be another
    one."""
    if getattr(request, "mask", None) or getattr(request, "depth", None):
        return []
    views: list[CameraView] = getattr(request, "views", [])
    sources: list[Any] = [view.image for view in views] or [getattr(request, "image", None)]
    return [Sample(image=source) for source in sources if isinstance(source, ImageRef)]


def _camera_of(output: Output, cameras: Sequence[StoredCamera]) -> str | None:
    """The stored camera that gives this output its camera, plane and tool; None if there is
    none."""
    if output.camera is None:
        return None
    wanted = CameraBody(
        intrinsics=output.camera.intrinsics,
        T_world_camera=output.camera.T_world_camera,
        T_flange_tool=output.T_flange_tool,
        plane=output.plane,
    )
    unmeasured = {"sigma_m": None, "sigma_rad": None}
    return next(
        (one.name for one in cameras if one.camera.model_copy(update=unmeasured) == wanted), None
    )
