"""Is the service alive, is it ready, and what can it do."""

from __future__ import annotations

from typing import Literal

from dlo_client.version import __version__
from fastapi import APIRouter
from pydantic import BaseModel, Field

from services import documents
from services.access import BackendDep
from services.problems import ProblemError
from services.readiness import hindrance

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """A probe's answer; one that is not `ok` is a problem."""

    status: Literal["ok"] = Field(
        default="ok", description="always `ok`; a probe that fails answers with a problem"
    )


class Version(BaseModel):
    """The release that answers; the SDK and the library of that release have the same version."""

    version: str = Field(default=__version__, description="of the service, as in its package")


@router.get("/healthz")
async def alive() -> Health:
    """The process answers."""
    return Health()


@router.get("/version")
async def which() -> Version:
    """The version of the service."""
    return Version()


@router.get("/readyz", responses=documents.problems())
def ready(backend: BackendDep) -> Health:
    """The queue answers, and a live worker has loaded and warmed its networks."""
    if why_not := hindrance(backend.queue):
        raise ProblemError(503, "not_ready", why_not, headers={"Retry-After": "1"})
    return Health()
