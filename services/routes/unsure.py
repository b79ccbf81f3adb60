"""``/v1/unsure``: the pictures that the service was least sure of, for whoever sent them."""

from __future__ import annotations

from typing import Annotated

from dlo_client.contracts.unsure import UnsurePicture
from fastapi import APIRouter, Path, Response

from services import documents
from services.access import BackendDep, Reader, Submitter
from services.problems import ProblemError

router = APIRouter(prefix="/v1/unsure", tags=["models"])

Id = Annotated[str, Path(pattern=r"^[0-9a-f]{64}$", description="as in the list")]
_MEDIA_TYPE = "application/octet-stream"


@router.get("", responses=documents.problems(403, 429))
def list_unsure(caller: Reader, backend: BackendDep) -> list[UnsurePicture]:
    """The caller's pictures, the least sure first; kept from requests with `keep_if_unsure`."""
    return backend.unsure.listed(caller.owner)


@router.get(
    "/{picture_id}",
    response_class=Response,
    responses={200: {"content": {_MEDIA_TYPE: {}}}, **documents.problems(403, 404, 429)},
)
def read_unsure(picture_id: Id, caller: Reader, backend: BackendDep) -> Response:
    """One of them, as it was sent."""
    try:
        return Response(backend.unsure.picture(caller.owner, picture_id), media_type=_MEDIA_TYPE)
    except FileNotFoundError:
        raise _unknown() from None


@router.delete("/{picture_id}", status_code=204, responses=documents.problems(403, 404, 429))
def drop_unsure(picture_id: Id, caller: Submitter, backend: BackendDep) -> None:
    """Forget one of them."""
    try:
        backend.unsure.drop(caller.owner, picture_id)
    except FileNotFoundError:
        raise _unknown() from None


def _unknown() -> ProblemError:
    return ProblemError(404, "unknown_picture", "no picture that is kept for you has this id")
