"""What the routes are given, by type, and who may call. (Async throughout: these need no threads.)"""

from __future__ import annotations

import hashlib
import hmac
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from prometheus_client import CollectorRegistry

from services.preview import Previews
from services.problems import ProblemError
from services.settings import ServiceSettings
from services.submissions import Submissions
from services.uploads import Uploads
from workers.blobs import FolderBlobs
from workers.queue import AsyncJobQueue, JobQueue


@dataclass(frozen=True)
class Backend:
    """What one application works with; none of it is state that a second replica would miss."""

    settings: ServiceSettings
    queue: JobQueue
    waiting: AsyncJobQueue
    blobs: FolderBlobs
    uploads: Uploads
    submissions: Submissions
    previews: Previews
    registry: CollectorRegistry


async def _backend(request: Request) -> Backend:
    backend: Backend = request.app.state.backend
    return backend


BackendDep = Annotated[Backend, Depends(_backend)]

_bearer = HTTPBearer(auto_error=False, description="An API key; not asked for when the service has none.")


async def _authorize(
    backend: BackendDep, bearer: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> None:
    """Let only holders of a key through; with no keys configured the service listens on loopback only."""
    hashes = backend.settings.api_key_hashes
    if not hashes:
        return
    digest = hashlib.sha256(bearer.credentials.encode()).hexdigest() if bearer else ""
    matches = [hmac.compare_digest(digest, known) for known in hashes]  # all, so that time tells nothing
    if not any(matches):
        detail = "send a valid API key as `Authorization: Bearer …`"
        raise ProblemError(401, "unauthorized", detail, headers={"WWW-Authenticate": "Bearer"})


Authorized = Depends(_authorize)
