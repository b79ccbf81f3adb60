"""``/v1/cameras``: stored calibrations, which recipes name."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any

from anyio import to_thread
from dlo_client.contracts.recipes import CAMERA_NAME, CameraBody, StoredCamera
from fastapi import APIRouter, Path, Query, Request, Response

from services import documents
from services.access import Admin, BackendDep, Reader
from services.bodies import parsed
from services.calibration_files import LARGEST_BYTES, intrinsics_of
from services.multipart import media_type, whole
from services.problems import ProblemError, field_error
from services.recipes import camera_of, unknown
from workers.kept import FullError

router = APIRouter(prefix="/v1/cameras", tags=["recipes"])

Name = Annotated[str, Path(pattern=CAMERA_NAME, description="what recipes call the camera")]
_YAML = ("application/yaml", "application/x-yaml", "text/yaml", "text/x-yaml")


@router.put(
    "/{name}",
    responses={
        201: {"model": StoredCamera},
        **documents.problems(403, 408, 413, 415, 422, 429, 507),
    },
    openapi_extra={"requestBody": documents.CALIBRATION},
)
async def store_camera(
    request: Request,
    name: Name,
    caller: Admin,
    backend: BackendDep,
    response: Response,
    kalibr: Annotated[
        str, Query(max_length=64, description="camera of a Kalibr camchain")
    ] = "cam0",
) -> StoredCamera:
    """Store a calibration; the next version if there is one. Needs the scope `admin` where there
    are keys.

    A file of ROS, OpenCV or Kalibr (`application/yaml`) brings the intrinsics alone and keeps the
    poses."""
    kind = media_type(request)
    if kind not in ("application/json", *_YAML):
        detail = f"send application/json or application/yaml, not {kind or 'a body without a content type'}"
        raise ProblemError(415, "unsupported_media_type", detail)
    text = await whole(request, field="body", max_bytes=LARGEST_BYTES)
    if kind == "application/json":
        body = parsed(text, CameraBody)
    else:
        before = await to_thread.run_sync(backend.queue.cameras.get, name)
        poses = dict(camera_of(before).camera) if before else {}
        body = CameraBody(**{**poses, "intrinsics": _read(text, kalibr)})
    stored = StoredCamera(
        name=name, version=1, created_at=datetime.now(UTC), author=caller.owner, camera=body
    )
    kept = stored.model_dump_json(exclude={"name", "version"}, exclude_none=True)
    try:
        version = await to_thread.run_sync(backend.queue.cameras.put, name, kept)
    except FullError as error:
        raise ProblemError(507, "storage_full", str(error)) from None
    response.status_code = 201 if version == 1 else 200
    return stored.model_copy(update={"version": version})


@router.get("", responses=documents.problems(403, 429))
def list_cameras(_: Reader, backend: BackendDep) -> list[StoredCamera]:
    """The latest version of every camera, by name."""
    return [camera_of(kept) for kept in backend.queue.cameras.latest()]


@router.get("/{name}", responses=documents.problems(403, 404, 429))
def read_camera(
    name: Name,
    _: Reader,
    backend: BackendDep,
    version: Annotated[
        int | None, Query(ge=1, description="of the camera; default the latest")
    ] = None,
) -> StoredCamera:
    """A camera, the latest version or another of the last hundred."""
    kept = backend.queue.cameras.get(name, version)
    if kept is None:
        raise unknown("camera", name)
    return camera_of(kept)


@router.delete("/{name}", status_code=204, responses=documents.problems(403, 404, 429))
def delete_camera(name: Name, _: Admin, backend: BackendDep) -> None:
    """Forget a camera and its history; recipes that name it can no longer run."""
    if not backend.queue.cameras.delete(name):
        raise unknown("camera", name)


def _read(text: bytes, camera: str) -> Any:
    try:
        return intrinsics_of(text.decode("utf-8", "replace"), camera)
    except ValueError as error:
        raise field_error("body", str(error), code="invalid_calibration") from None
