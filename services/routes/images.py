"""``/v1/images``: pictures by content."""

from __future__ import annotations

from contextlib import aclosing
from typing import Annotated

from anyio import to_thread
from dlo_client.contracts import ImageInfo
from fastapi import APIRouter, Path, Request, Response

from services import documents, preview
from services.access import Backend, BackendDep, Caller, Reader, Submitter
from services.multipart import Allowed, media_type, parts, whole
from services.problems import ProblemError, field_error
from workers.blobs import BlobMissing
from workers.pictures.headers import PictureError

router = APIRouter(prefix="/v1/images", tags=["images"])


@router.post(
    "",
    status_code=201,
    responses=documents.problems(403, 408, 413, 415, 429, 507),
    openapi_extra={"requestBody": documents.PICTURE},
)
async def upload_image(request: Request, caller: Submitter, backend: BackendDep) -> ImageInfo:
    """Keep a picture, to be named by its id in requests. The same bytes give the same id."""
    limit = backend.settings.max_image_bytes
    kind = media_type(request)
    if kind == "multipart/form-data":
        return await _keep_part(request, caller, backend)
    if kind and kind != "application/octet-stream" and not kind.startswith("image/"):
        detail = f"send the picture as image/*, application/octet-stream or multipart/form-data, not {kind}"
        raise ProblemError(415, "unsupported_media_type", detail)
    return await _keep(
        await whole(request, field="image", max_bytes=limit), "image", caller, backend
    )


@router.get(
    "/{image_id}/preview",
    response_class=Response,
    responses={
        200: {"content": {preview.MEDIA_TYPE: {}}, "description": "PNG"},
        **documents.problems(404),
    },
)
async def read_preview(
    image_id: Annotated[str, Path(description="as `POST /v1/images` gave it")],
    _: Reader,
    backend: BackendDep,
) -> Response:
    """An uploaded picture, upright, in 8 bits and at most 2048 pixels wide and high, for a browser
    to show."""
    try:
        data = await to_thread.run_sync(backend.blobs.get, image_id)
    except BlobMissing:
        raise ProblemError(
            404, "unknown_image", "no uploaded picture has this id (any longer)"
        ) from None
    try:
        png = await backend.previews.of(data)
    except PictureError as error:
        raise field_error("image", str(error), code="invalid_image") from None
    headers = {"Cache-Control": "private, max-age=3600, immutable"}
    return Response(png, media_type=preview.MEDIA_TYPE, headers=headers)


async def _keep_part(request: Request, caller: Caller, backend: Backend) -> ImageInfo:
    kept = None
    async with aclosing(
        parts(request, {"file": Allowed(1, backend.settings.max_image_bytes)})
    ) as stream:
        async for part in stream:
            kept = await _keep(part.data, part.name, caller, backend)
    if kept is None:
        raise field_error("file", "this part is missing: it holds the picture")
    return kept


async def _keep(data: bytes, field: str, caller: Caller, backend: Backend) -> ImageInfo:
    info, staged = await backend.uploads.stage(data, field=field, cloud=True)
    try:
        await to_thread.run_sync(
            backend.queue.charge, caller.owner, caller.most_bytes, {info.id: info.bytes}
        )
        await to_thread.run_sync(staged.keep)
    finally:
        await to_thread.run_sync(staged.drop)
    return info
