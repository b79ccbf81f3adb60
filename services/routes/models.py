"""``/v1/models``: the networks, those that ship and those that users adapt or bring."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from dlo_client.contracts import (
    ImportNetworkRequest,
    ImportNetworkResult,
    JobState,
    NetworkInfo,
    UploadRef,
)
from dlo_client.contracts.networks import NetworkName, VersionChoice
from fastapi import APIRouter, Path, Query, Request, Response

from services import documents, waiting
from services.access import Backend, BackendDep, Caller, Reader, Submitter
from services.multipart import whole
from services.problems import ProblemError, field_error
from services.submitting import IdempotencyKey
from services.telemetry import origin
from workers.networks.package import SUFFIX, PackageError, unpack

router = APIRouter(prefix="/v1/models", tags=["models"])

MEDIA_TYPE = "application/octet-stream"
_CHECKED_WITHIN_S = 60.0
_OVERHEAD_BYTES = 128 * 1024
"""Of a network's file besides its weights."""

Name = Annotated[str, Path(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}$", description="as in the list")]
Version = Annotated[
    int | None, Query(ge=1, description="default: the one that the name stands for")
]


@router.get("", responses=documents.problems(403, 429))
def list_models(caller: Reader, backend: BackendDep) -> list[NetworkInfo]:
    """The networks that live workers have, and those that users adapted or brought: any key may
    name these too.

    `default`: what a request of this key takes that names none.
    """
    stored = [backend.networks.info(name) for name in backend.networks.names()]
    return _with_default(
        [*backend.queue.networks(), *stored], caller.model or backend.settings.default_model
    )


@router.get("/{name}", responses=documents.problems(403, 404, 429))
def read_model(name: Name, caller: Reader, backend: BackendDep) -> NetworkInfo:
    """A network, with all its versions if it was adapted or brought here."""
    for network in list_models(caller, backend):
        if network.name == name:
            return network
    raise ProblemError(404, "unknown_network", "no network has this name")


@router.post(
    "",
    status_code=201,
    responses=documents.problems(403, 408, 413, 429, 504, 507),
    openapi_extra={"requestBody": documents.NETWORK},
)
async def import_model(
    request: Request,
    caller: Submitter,
    backend: BackendDep,
    name: Annotated[NetworkName | None, Query(description="default: the name in the file")] = None,
    idempotency_key: IdempotencyKey = None,
) -> NetworkInfo:
    """Take in a network from its file, as `GET /v1/models/{name}/file` gives it. A worker checks it
    first.

    It becomes the next version of its name; the first is what the name stands for, a later one is
    not until `PUT /v1/models/{name}` asks for it.
    """
    limit = backend.settings.max_network_bytes
    data = await whole(request, field="body", max_bytes=limit + _OVERHEAD_BYTES)
    await to_thread.run_sync(_look, data, limit)
    job_id = await to_thread.run_sync(_submit, backend, caller, data, name, idempotency_key)
    record = await waiting.ended(backend.waiting, job_id, _CHECKED_WITHIN_S)
    if record.job.state is JobState.SUCCEEDED and record.result:
        return ImportNetworkResult.model_validate_json(record.result).network
    if problem := record.job.problem:
        raise ProblemError(problem.status, problem.code, problem.detail, errors=problem.errors)
    detail = f"no worker has checked the network yet; its job {job_id} goes on"
    raise ProblemError(504, "not_checked_yet", detail, headers={"Location": f"/v1/jobs/{job_id}"})


@router.get(
    "/{name}/file",
    response_class=Response,
    responses={200: {"content": {MEDIA_TYPE: {}}}, **documents.problems(403, 404, 429)},
)
def read_model_file(
    name: Name, caller: Reader, backend: BackendDep, version: Version = None
) -> Response:
    """The file of a network: everything that another service needs to take it in."""
    _own(name, caller, backend)
    _, number = backend.networks.find(f"{name}@{version}" if version else name)
    headers = {"Content-Disposition": f'attachment; filename="{name}-{number}{SUFFIX}"'}
    return Response(backend.networks.file(name, number), media_type=MEDIA_TYPE, headers=headers)


@router.put("/{name}", responses=documents.problems(403, 404, 429))
def choose_version(
    choice: VersionChoice, name: Name, caller: Submitter, backend: BackendDep
) -> NetworkInfo:
    """Let the name stand for another of its versions: a newer one, or back to an older one."""
    _own(name, caller, backend)
    backend.networks.use(name, choice.version)
    return backend.networks.info(name)


@router.delete("/{name}", status_code=204, responses=documents.problems(403, 404, 409, 429))
def delete_model(
    name: Name,
    caller: Submitter,
    backend: BackendDep,
    version: Annotated[int | None, Query(ge=1, description="default: all of them")] = None,
) -> None:
    """Delete a network, or one of its versions."""
    _own(name, caller, backend)
    if not backend.networks.delete(name, version):
        detail = f"{name} stands for version {version}: let it stand for another one first"
        raise ProblemError(409, "in_service", detail)


def _own(name: str, caller: Caller, backend: Backend) -> None:
    """Raises ProblemError, or NetworkUnknownError."""
    if any(network.name == name for network in backend.queue.networks()):
        raise ProblemError(403, "forbidden", f"{name} ships with the service")
    if not caller.may_change(backend.networks.owner(name)):
        raise ProblemError(403, "forbidden", f"{name} is a network of another API key")


def _look(data: bytes, limit: int) -> None:
    """What a look without computing shows to be no network is not given to a worker."""
    try:
        unpack(data, limit)
    except PackageError as error:
        raise field_error("body", str(error), code="invalid_network") from error


def _submit(
    backend: Backend, caller: Caller, data: bytes, name: str | None, key: str | None
) -> str:
    staged = backend.blobs.stage(data)

    def keep() -> None:
        backend.queue.charge(caller.owner, caller.most_bytes, {staged.blob_id: staged.bytes})
        staged.keep()

    try:
        request = ImportNetworkRequest(file=UploadRef(id=staged.blob_id), name=name, timeout_s=300)
        job, _ = backend.queue.submit(
            request,
            idempotency_key=key,
            request_digest=f"{name} {staged.blob_id}",
            keep=keep,
            origin=origin(caller.owner),
            most_jobs=caller.most_jobs,
        )
    finally:
        staged.drop()
    return job.id


def _with_default(networks: list[NetworkInfo], chosen: str | None) -> list[NetworkInfo]:
    """The default of the foreground is ``chosen``, if it is there."""
    name = (chosen or "").partition("@")[0]
    if not any(network.name == name for network in networks):
        return networks
    return [
        network.model_copy(update={"default": network.name == name})
        if network.task == "foreground"
        else network
        for network in networks
    ]
