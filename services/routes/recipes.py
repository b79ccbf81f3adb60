"""``/v1/recipes``: numbered requests that a controller runs with pictures alone."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import Annotated

from anyio import to_thread
from dlo_client.contracts import AnyJob
from dlo_client.contracts.recipes import (
    LARGEST_NUMBER,
    Recipe,
    RecipeBody,
    RecipeUsed,
    RunInput,
    Sample,
    StoredCamera,
)
from fastapi import APIRouter, Path, Query, Request, Response

from services import bodies, documents
from services.access import Admin, Backend, BackendDep, Caller, Reader, Submitter
from services.problems import ProblemError, field_error
from services.recipes import Composer, camera_of, composer, recipe_of, unknown
from services.submissions import Submission
from services.submitting import IdempotencyKey, Wait, awaited, check_room, submitted
from workers.kept import FullError

router = APIRouter(prefix="/v1/recipes", tags=["recipes"])

Number = Annotated[
    int, Path(ge=0, le=LARGEST_NUMBER, description="of the recipe, as controllers call it")
]
Version = Annotated[int | None, Query(ge=1, description="of the recipe; default the latest")]


@router.put(
    "/{number}",
    responses={201: {"model": Recipe}, **documents.problems(403, 408, 413, 415, 422, 429, 507)},
    openapi_extra={"requestBody": documents.RECIPE_BODY},
)
async def store_recipe(
    request: Request, number: Number, caller: Admin, backend: BackendDep, response: Response
) -> Recipe:
    """Store a recipe; the next version if there is one. Needs the scope `admin` where there are
    keys."""
    body = await bodies.read(request, RecipeBody, backend.settings.max_request_bytes)
    recipe = await to_thread.run_sync(_store, number, body, caller, backend)
    response.status_code = 201 if recipe.version == 1 else 200
    return recipe


def _store(number: int, body: RecipeBody, caller: Caller, backend: Backend) -> Recipe:
    camera = _camera(backend, body.camera) if body.camera else None
    named = dict.fromkeys(composer(body, camera).check(), "request")
    named |= {
        sample.image.id: f"samples.{index}.image" for index, sample in enumerate(body.samples)
    }
    for picture, field in named.items():
        if not backend.uploads.keep(picture):
            message = "no uploaded picture has this id (any longer); upload it first"
            raise field_error(field, message, code="unknown_image")
    text = Recipe(
        number=number, version=1, created_at=datetime.now(UTC), author=caller.owner, **dict(body)
    ).model_dump_json(exclude={"number", "version"})
    try:
        version = backend.queue.recipes.put(str(number), text, list(named))
    except FullError as error:
        raise ProblemError(507, "storage_full", str(error)) from None
    return _recipe(backend, number, version)


@router.get("", responses=documents.problems(403, 429))
def list_recipes(_: Reader, backend: BackendDep) -> list[Recipe]:
    """The latest version of every recipe, by number."""
    return sorted(
        (recipe_of(int(kept.name), kept) for kept in backend.queue.recipes.latest()),
        key=lambda one: one.number,
    )


@router.get("/{number}", responses=documents.problems(403, 404, 429))
def read_recipe(number: Number, _: Reader, backend: BackendDep, version: Version = None) -> Recipe:
    """A recipe, the latest version or another of the last hundred."""
    return _recipe(backend, number, version)


@router.get("/{number}/versions", responses=documents.problems(403, 404, 429))
def list_versions(number: Number, _: Reader, backend: BackendDep) -> list[Recipe]:
    """The versions of a recipe, newest first."""
    versions = [recipe_of(number, kept) for kept in backend.queue.recipes.history(str(number))]
    if not versions:
        raise unknown("recipe", number)
    return versions


@router.delete("/{number}", status_code=204, responses=documents.problems(403, 404, 429))
def delete_recipe(number: Number, _: Admin, backend: BackendDep) -> None:
    """Forget a recipe and its history."""
    if not backend.queue.recipes.delete(str(number)):
        raise unknown("recipe", number)


@router.post(
    "/{number}/run",
    status_code=202,
    response_model=AnyJob,
    responses={
        200: {"model": AnyJob, "description": "It ended within `wait`"},
        **documents.problems(403, 404, 408, 409, 410, 413, 415, 429, 507),
    },
    openapi_extra={"requestBody": documents.RUN},
)
async def run_recipe(
    request: Request,
    number: Number,
    caller: Submitter,
    backend: BackendDep,
    version: Version = None,
    wait: Wait = 0.0,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Put the recipe's request with these pictures into the queue; as `POST /v1/jobs` with
    `wait`."""
    await check_room(request, caller, backend, idempotency_key)
    used, composed = await to_thread.run_sync(_composer, backend, number, version)
    async with backend.submissions.read_run(
        request, composed.compose, caller.defaults
    ) as submission:
        job_id = await submitted(_naming(submission, used), caller, backend, idempotency_key)
    return await awaited(backend, job_id, wait)


@router.post(
    "/{number}/dry-run",
    status_code=202,
    responses=documents.problems(403, 404, 409, 410, 413, 429, 507),
)
async def dry_run(
    number: Number, caller: Submitter, backend: BackendDep, version: Version = None
) -> list[AnyJob]:
    """Run the recipe with the pictures that are stored with it: one job for all of them where its
    request has `views`, else one job each."""
    recipe = await to_thread.run_sync(_recipe, backend, number, version)
    used, composed = await to_thread.run_sync(_composer, backend, number, recipe.version)
    if not recipe.samples:
        raise field_error(
            "samples", "the recipe has no stored pictures", code="no_samples", status=409
        )
    groups = [recipe.samples] if composed.has_views else [[sample] for sample in recipe.samples]
    submissions = [
        await backend.submissions.named(_input(group), composed.compose, caller.defaults)
        for group in groups
    ]
    ids = [await submitted(_naming(one, used), caller, backend, None) for one in submissions]
    return [(await backend.waiting.get(job_id)).job for job_id in ids]


def _input(samples: list[Sample]) -> RunInput:
    flange = [sample.flange for sample in samples if sample.flange is not None]
    return RunInput(images=[sample.image for sample in samples], flange=flange)


def _naming(submission: Submission, used: RecipeUsed) -> Submission:
    """So that the job names the recipe."""
    return Submission(replace(submission.entry, recipe=used.model_dump_json()), submission.staged)


def _composer(backend: Backend, number: int, version: int | None) -> tuple[RecipeUsed, Composer]:
    recipe = _recipe(backend, number, version)
    camera = _camera(backend, recipe.camera) if recipe.camera else None
    return RecipeUsed(number=number, version=recipe.version), composer(recipe, camera)


def _recipe(backend: Backend, number: int, version: int | None) -> Recipe:
    kept = backend.queue.recipes.get(str(number), version)
    if kept is None:
        raise unknown("recipe", number)
    return recipe_of(number, kept)


def _camera(backend: Backend, name: str) -> StoredCamera:
    kept = backend.queue.cameras.get(name)
    if kept is None:
        raise field_error(
            "camera", f"there is no stored camera {name!r}; see /v1/cameras", code="unknown_camera"
        )
    return camera_of(kept)
