"""``/v1/label-folders``: those of ``DLO_LABELS_DIR``, for the label bench;
``/v1/label-exports``."""

from __future__ import annotations

import mimetypes
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Header, Path, Query, Request, Response
from pydantic import BaseModel, Field

from services import documents
from services.access import BackendDep, Reader, Submitter
from services.label_export import MEDIA_TYPE, ExportFormat
from services.label_folders import Kept, State
from services.multipart import whole
from services.problems import ProblemError

router = APIRouter(prefix="/v1", tags=["labels"])
_MOST_BYTES = 64 * 1024 * 1024
_LABEL: dict[str, Any] = {
    "required": True,
    "description": "A label in our own format, `dlo-label/1`",
    "content": {"application/json": {"schema": {"type": "object"}}},
}

_LINES: dict[str, Any] = {"text/plain": {"schema": {"type": "string"}}}

Folder = Annotated[str, Path(description="as in the list of folders")]
Name = Annotated[
    str,
    Query(min_length=1, max_length=1000, description="of the picture, as in the list of pictures"),
]


class LabelFolderNames(BaseModel):
    """The label folders of this service."""

    folders: list[str] = Field(description="their names")


class LabelledPicture(BaseModel):
    """A picture of a label folder."""

    name: str = Field(description="its path within the folder's source")
    sha256: str = Field(description="of its bytes; empty where it is not known")
    certainty: float = Field(description="0 to 1, the lowest score of all: what to look at first")
    state: State = Field(description="`changed`: by somebody, and nobody has confirmed it")


class LabelFolder(BaseModel):
    """What is in a label folder."""

    pictures: list[LabelledPicture] = Field(description="those that have a label, by name")


@router.get("/label-folders", responses=documents.problems(403, 429))
def list_folders(_: Reader, backend: BackendDep) -> LabelFolderNames:
    """The label folders below `DLO_LABELS_DIR`."""
    return LabelFolderNames(folders=backend.labels.names())


@router.post(
    "/label-exports",
    response_class=Response,
    responses={
        200: {"content": {MEDIA_TYPE: {}}, "description": "ZIP"},
        **documents.problems(403, 408, 413, 429, 501),
    },
    openapi_extra={
        "requestBody": {"required": True, "description": "A label in each line", "content": _LINES}
    },
)
async def export_labels(
    request: Request,
    _: Submitter,
    backend: BackendDep,
    format: Annotated[ExportFormat, Query(description="of the tool that is to read them")],  # noqa: A002
) -> Response:
    """Labels of our own format in that of another tool."""
    lines = await whole(request, field="labels", max_bytes=_MOST_BYTES)
    archive = await backend.exports.archive(format, lines)
    return Response(archive, media_type=MEDIA_TYPE)


@router.get("/label-folders/{folder}", responses=documents.problems(403, 404, 409, 429))
def list_pictures(folder: Folder, _: Reader, backend: BackendDep) -> LabelFolder:
    """The labelled pictures of a folder, and which of them somebody has changed or confirmed."""
    pictures = [
        LabelledPicture(
            name=entry.name, sha256=entry.sha256, certainty=entry.certainty, state=state
        )
        for entry, state in backend.labels.entries(folder)
    ]
    return LabelFolder(pictures=pictures)


@router.get(
    "/label-folders/{folder}/label",
    response_class=Response,
    responses={
        200: {"content": _LABEL["content"], "description": "The label"},
        **documents.problems(403, 404, 409, 429),
    },
)
def read_label(folder: Folder, name: Name, _: Reader, backend: BackendDep) -> Response:
    """The newest label of a picture: a draft, a correction, or the service's own. Its ETag is asked
    for to save it."""
    return _answer(backend.labels.read(folder, name))


@router.put(
    "/label-folders/{folder}/label",
    status_code=204,
    response_class=Response,
    responses=documents.problems(403, 404, 408, 409, 412, 413, 428, 429),
    openapi_extra={"requestBody": _LABEL},
)
async def save_label(
    folder: Folder,
    name: Name,
    request: Request,
    _: Submitter,
    backend: BackendDep,
    if_match: Annotated[
        str | None, Header(description="ETag of the label that this one takes the place of")
    ] = None,
) -> Response:
    """Save a label: as a correction where its `origin` is `corrected`, else as a draft. Answers 412
    when somebody else saved one since the ETag was read."""
    if not if_match:
        raise ProblemError(428, "etag_required", "send the label's ETag as `If-Match`")
    content = await whole(request, field="label", max_bytes=_MOST_BYTES)
    kept = await to_thread.run_sync(backend.labels.write, folder, name, content, if_match)
    return Response(status_code=204, headers={"ETag": kept.etag})


@router.get(
    "/label-folders/{folder}/picture",
    response_class=Response,
    responses={
        200: {"content": {"image/*": {}}, "description": "Its bytes"},
        **documents.problems(403, 404, 409, 429),
    },
)
def read_picture(folder: Folder, name: Name, _: Reader, backend: BackendDep) -> Response:
    """The picture itself, if it still is the one that was labelled."""
    content = backend.labels.picture(folder, name)
    media_type = mimetypes.guess_type(name)[0] or "application/octet-stream"
    return Response(
        content, media_type=media_type, headers={"Cache-Control": "private, max-age=600"}
    )


def _answer(kept: Kept) -> Response:
    return Response(
        kept.content,
        media_type="application/json",
        headers={"ETag": kept.etag, "Cache-Control": "no-cache"},
    )
