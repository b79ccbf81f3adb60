"""What the routes are given, by type, and who may call. (Async throughout: these need no
threads.)"""

from __future__ import annotations

from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request, WebSocket
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from prometheus_client import CollectorRegistry

from services.keys import Key, KeyRing, Scope
from services.label_export import LabelExports
from services.label_folders import LabelFolders
from services.preview import Previews
from services.problems import ProblemError
from services.settings import ServiceSettings
from services.submissions import Submissions
from services.uploads import Uploads
from workers.blobs import Blobs
from workers.networks.store import NetworkStore
from workers.queue import AsyncJobQueue, JobQueue
from workers.tracks import Tracks
from workers.unsure import UnsureStore


@dataclass(frozen=True)
class Backend:
    """What one application works with; none of it is state that a second replica would miss."""

    settings: ServiceSettings
    queue: JobQueue
    waiting: AsyncJobQueue
    blobs: Blobs
    networks: NetworkStore
    unsure: UnsureStore
    uploads: Uploads
    submissions: Submissions
    previews: Previews
    registry: CollectorRegistry
    keys: KeyRing
    labels: LabelFolders
    exports: LabelExports
    tracks: Tracks
    under_way: Counter[str] = field(default_factory=Counter)
    """Requests that this replica answers now, by owner."""


async def _backend(request: Request) -> Backend:
    backend: Backend = request.app.state.backend
    return backend


BackendDep = Annotated[Backend, Depends(_backend)]

_bearer = HTTPBearer(
    auto_error=False, description="An API key; not asked for when the service has none."
)


@dataclass(frozen=True)
class Caller:
    """Who calls: the holder of ``key``, or anybody on this machine where the service has none."""

    key: Key | None

    @property
    def owner(self) -> str:
        return self.key.name if self.key else ""

    @property
    def sees(self) -> str | None:
        """The owner whose jobs the caller sees; None for everybody's."""
        return self.key.name if self.key and not self.key.allows("admin") else None

    def may_change(self, owner: str) -> bool:
        """What belongs to ``owner``."""
        return self.key is None or self.key.allows("admin") or self.key.name == owner

    @property
    def defaults(self) -> dict[str, object]:
        """Fields of requests that leave them out."""
        given = {"default_model": self.model, "keep_if_unsure": self.keeps_unsure}
        return {name: value for name, value in given.items() if value}

    @property
    def model(self) -> str | None:
        """The foreground network of requests that name none."""
        return self.key.model if self.key else None

    @property
    def keeps_unsure(self) -> bool:
        """Whether pictures that the service was not sure of may be kept for the key's owner."""
        return self.key is not None and self.key.keep_if_unsure

    @property
    def most_jobs(self) -> int | None:
        return self.key.jobs if self.key else None

    @property
    def most_bytes(self) -> int | None:
        return self.key.stored_bytes if self.key else None


def _needs(scope: Scope) -> Callable[..., AsyncIterator[Caller]]:
    """A dependency that lets only holders of a key with ``scope`` through, within the limits of
    their key."""

    async def authorize(
        backend: BackendDep,
        bearer: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
    ) -> AsyncIterator[Caller]:
        async with _let_in(backend, bearer.credentials if bearer else None, scope) as caller:
            yield caller

    return authorize


@asynccontextmanager
async def _let_in(backend: Backend, presented: str | None, scope: Scope) -> AsyncIterator[Caller]:
    """The holder of the key that was ``presented``, counted as under way; raises ProblemError."""
    if not backend.settings.has_keys:
        yield Caller(None)
        return
    key = backend.keys.find(presented) if presented else None
    if key is None:
        detail = "send a valid API key as `Authorization: Bearer …`"
        raise ProblemError(401, "unauthorized", detail, headers={"WWW-Authenticate": "Bearer"})
    if not key.allows(scope):
        raise ProblemError(403, "forbidden", f"this API key does not have the scope `{scope}`")
    await _check_pace(backend, key)
    backend.under_way[key.name] += 1
    try:
        yield Caller(key)
    finally:
        backend.under_way[key.name] -= 1


@asynccontextmanager
async def streaming_caller(
    socket: WebSocket, backend: Backend, scope: Scope
) -> AsyncIterator[Caller]:
    """Who opens a WebSocket, by the same header; raises ProblemError before it is accepted."""
    scheme, _, presented = socket.headers.get("authorization", "").partition(" ")
    async with _let_in(backend, presented if scheme.lower() == "bearer" else None, scope) as caller:
        yield caller


async def _check_pace(backend: Backend, key: Key) -> None:
    if key.requests_at_once and backend.under_way[key.name] >= key.requests_at_once:
        raise _too_many("too many requests of this API key are under way", 1.0)
    if key.requests_per_minute and (
        wait_s := await backend.waiting.pace(key.name, key.requests_per_minute)
    ):
        raise _too_many(
            f"this API key may send {key.requests_per_minute} requests a minute", wait_s
        )


def _too_many(detail: str, after_s: float) -> ProblemError:
    return ProblemError(
        429, "too_many_requests", detail, headers={"Retry-After": str(max(1, round(after_s)))}
    )


Reader = Annotated[Caller, Depends(_needs("read"))]
Submitter = Annotated[Caller, Depends(_needs("submit"))]
Admin = Annotated[Caller, Depends(_needs("admin"))]


def has_form_of_id(text: str) -> bool:
    """Whether a text could be the id of a job or of a track; they are looked up only then, for they
    become part of keys."""
    return len(text) == 32 and set(text) <= set("0123456789abcdef")
