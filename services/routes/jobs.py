"""``/v1/jobs``: submit, look at, wait for, cancel, list."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from anyio import to_thread
from dlo_client.contracts import AnyJob, JobKind, JobPage, JobState
from dlo_client.contracts.recipes import RecipeBody
from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from fastapi.responses import FileResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent

from services import documents, waiting
from services.access import BackendDep, Reader, Submitter, has_form_of_id
from services.problems import ProblemError
from services.recipe_of_job import body_of, recipe_of_job
from services.recipes import camera_of, recipe_of
from services.submitting import JOBS, IdempotencyKey, Wait, answer, awaited, check_room, submitted
from workers.queue import JobUnknown
from workers.record import REQUEST, JobRecord

router = APIRouter(prefix=JOBS, tags=["jobs"])

Cursor = Annotated[
    str | None, Query(pattern=r"^\d{1,18}$", description="`next_cursor` of the page before")
]
EventId = Annotated[
    str,
    Header(
        alias="Last-Event-ID", pattern=r"^\d{1,20}-\d{1,20}$|^0$", description="resume after it"
    ),
]


async def _job_id(job_id: Annotated[str, Path(description="as in the job")]) -> str:
    if not has_form_of_id(job_id):
        raise JobUnknown(job_id)
    return job_id


JobId = Annotated[str, Depends(_job_id)]


async def _record(job_id: JobId, caller: Reader, backend: BackendDep) -> JobRecord:
    record = await backend.waiting.get(job_id)
    if caller.sees not in (None, record.owner):
        raise JobUnknown(job_id)
    return record


async def _own_record(job_id: JobId, caller: Submitter, backend: BackendDep) -> JobRecord:
    return await _record(job_id, caller, backend)


Existing = Annotated[JobRecord, Depends(_record)]
Cancellable = Annotated[JobRecord, Depends(_own_record)]


@router.post(
    "",
    status_code=202,
    response_model=AnyJob,
    responses={
        200: {"model": AnyJob, "description": "It ended within `wait`"},
        **documents.problems(403, 408, 409, 410, 413, 415, 429, 507),
    },
    openapi_extra={"requestBody": documents.SUBMISSION},
)
async def submit_job(
    request: Request,
    caller: Submitter,
    backend: BackendDep,
    wait: Wait = 0.0,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Put a request into the queue; with `wait`, answer 200 with the ended job if it ends in
    time."""
    await check_room(request, caller, backend, idempotency_key)
    async with backend.submissions.read(request, caller.defaults) as submission:
        job_id = await submitted(submission, caller, backend, idempotency_key)
    return await awaited(backend, job_id, wait)


@router.get("", responses=documents.problems(403, 429))
def list_jobs(
    caller: Reader,
    backend: BackendDep,
    limit: Annotated[int, Query(ge=1, le=200, description="jobs a page")] = 50,
    cursor: Cursor = None,
    state: Annotated[JobState | None, Query(description="only jobs in this state")] = None,
    kind: Annotated[JobKind | None, Query(description="only jobs of this kind")] = None,
) -> JobPage:
    """Jobs newest first, without their results. Only a page without `next_cursor` is the last."""
    return backend.queue.recent(
        limit=limit, cursor=cursor, state=state, kind=kind, owner=caller.sees
    )


@router.get("/{job_id}", response_model=AnyJob, responses=documents.problems(403, 404, 410, 429))
async def read_job(record: Existing, backend: BackendDep, wait: Wait = 0.0) -> Response:
    """The job; with `wait`, as soon as it has ended or the seconds are over."""
    if wait and not record.job.state.final:
        record = await waiting.ended(backend.waiting, record.job.id, wait)
    return answer(record)


@router.get("/{job_id}/recipe", responses=documents.problems(403, 404, 409, 410, 429))
def read_recipe_of_job(record: Existing, backend: BackendDep) -> RecipeBody:
    """A recipe that repeats the job: its request without pictures, with these as samples. Of a job
    that a recipe made, that recipe. Store it with `PUT /v1/recipes/{number}`."""
    job = record.job
    kept = (
        backend.queue.recipes.get(str(job.recipe.number), job.recipe.version)
        if job.recipe
        else None
    )
    if kept is not None and job.recipe is not None:
        return body_of(recipe_of(job.recipe.number, kept))
    request = backend.queue.request(job.id)
    if request is None:
        raise ProblemError(
            409,
            "request_not_kept",
            "the request of this job was too long to be kept when it had ended",
        )
    cameras = [camera_of(camera) for camera in backend.queue.cameras.latest()]
    return recipe_of_job(job, REQUEST.validate_json(request), cameras)


@router.delete("/{job_id}", response_model=AnyJob, responses=documents.problems(403, 404, 410, 429))
async def cancel_job(record: Cancellable, backend: BackendDep) -> Response:
    """Cancel a queued or running job; one that has ended stays as it is."""
    job_id = record.job.id
    await to_thread.run_sync(backend.queue.cancel, job_id)
    return answer(await backend.waiting.get(job_id))


@router.get(
    "/{job_id}/events",
    response_class=EventSourceResponse,
    responses=documents.problems(403, 404, 410, 429),
)
async def follow_job(
    record: Existing, backend: BackendDep, last_event_id: EventId = "0"
) -> AsyncIterator[ServerSentEvent]:
    """Server-sent events of state and progress; the stream ends when the job does."""
    async for event in waiting.follow(backend.waiting, record.job, last_event_id):
        yield ServerSentEvent(id=event.id, data=event)


@router.get(
    "/{job_id}/files/{name}",
    response_class=FileResponse,
    responses={
        304: {"description": "`If-None-Match` names the file's ETag"},
        **documents.problems(403, 404, 410, 429),
    },
)
async def read_file(
    record: Existing,
    name: Annotated[str, Path(description="as in the job's `files`")],
    backend: BackendDep,
    if_none_match: Annotated[
        str | None, Header(description="ETag of the copy that the caller has")
    ] = None,
) -> Response:
    """A file of the job's result, as named in its `files`."""
    file = next((file for file in record.job.files if file.name == name), None)
    if file is None:
        raise ProblemError(404, "unknown_file", "the job has no file of this name")
    headers = {"ETag": f'"{file.sha256}"', "X-Content-Type-Options": "nosniff"}
    if if_none_match and (if_none_match == "*" or file.sha256 in if_none_match):
        return Response(status_code=304, headers=headers)
    path = await to_thread.run_sync(backend.blobs.path, file.sha256)
    if path is not None:
        return FileResponse(path, media_type=file.media_type, headers=headers)
    data = await to_thread.run_sync(backend.blobs.get, file.sha256)
    return Response(data, media_type=file.media_type, headers=headers)
