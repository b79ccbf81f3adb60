"""``/v1/labels``: labelled pictures, for jobs that learn from them."""

from __future__ import annotations

from anyio import to_thread
from dlo_client.contracts import LabelsInfo
from fastapi import APIRouter, Request

from services import documents
from services.access import Backend, BackendDep, Caller, Submitter
from services.multipart import whole
from services.problems import field_error
from workers.labelled_pictures import ArchiveError, pairs_of

router = APIRouter(prefix="/v1/labels", tags=["models"])


@router.post(
    "",
    status_code=201,
    responses=documents.problems(403, 408, 413, 429, 507),
    openapi_extra={"requestBody": documents.LABELS},
)
async def upload_labels(request: Request, caller: Submitter, backend: BackendDep) -> LabelsInfo:
    """Keep an archive of labelled pictures, to be named by its id in `adapt` requests."""
    data = await whole(request, field="body", max_bytes=backend.settings.max_labels_bytes)
    return await to_thread.run_sync(_keep, data, caller, backend)


def _keep(data: bytes, caller: Caller, backend: Backend) -> LabelsInfo:
    try:
        count = len(pairs_of(data))
    except ArchiveError as error:
        raise field_error("body", str(error), code="invalid_labels") from error
    staged = backend.blobs.stage(data)
    try:
        backend.queue.charge(caller.owner, caller.most_bytes, {staged.blob_id: staged.bytes})
        staged.keep()
    finally:
        staged.drop()
    return LabelsInfo(id=staged.blob_id, bytes=len(data), pictures=count)
