"""The HTTP application. Nothing is kept in its process: any number of replicas may answer.

Imports: contracts, the queue's door, the blobs and the settings; nothing that computes.
"""

from __future__ import annotations

import asyncio
import gc
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

import redis
import structlog
from anyio import to_thread
from dlo_client.version import __version__
from fastapi import FastAPI

from services import documents, problems, telemetry, validation
from services.access import Backend
from services.disk_metrics import DiskCollector
from services.exposure import exposed
from services.gate import Gate
from services.http_protocol import limit_connections
from services.keys import KeyRing
from services.label_export import LabelExports
from services.label_folders import LabelFolders
from services.metrics import RequestDurations, registry
from services.middleware import Requests
from services.preview import Previews
from services.routes import (
    cameras,
    docs,
    health,
    images,
    jobs,
    label_folders,
    labels,
    metrics,
    models,
    recipes,
    tracks,
    unsure,
    viewer,
    webhooks,
)
from services.settings import ServiceSettings
from services.submissions import ForegroundNames, Submissions
from services.uploads import Uploads
from workers import logs
from workers.blobs import open_blobs
from workers.networks.store import NetworkStore
from workers.queue import AsyncJobQueue, JobQueue
from workers.tracks import Tracks
from workers.unsure import UnsureStore

DESCRIPTION = """Finds deformable linear objects (cables, wires, ropes) in pictures.

Upload a picture, or send it along with a request; a job runs it; its result is JSON and files.
Every error is an RFC 9457 problem (`application/problem+json`) that names the fields at fault."""


_REAP_EVERY_S = 2.0
_LISTENS_AFTER_S = 0.3

log = structlog.get_logger(__name__)


def create_app(settings: ServiceSettings | None = None) -> FastAPI:
    """The application; without ``settings``, with those of the environment, and logs as these ask
    for."""
    if settings is None:  # started by a server of its own, not by a program that has done this
        settings = ServiceSettings()
        logs.configure(settings.log_level)
    backend = _assemble(settings)
    app = FastAPI(
        title="DLO perception service",
        version=__version__,
        description=DESCRIPTION,
        lifespan=_lifespan,
        docs_url=None,  # documentation pages of our own, without a network: routes.docs
        redoc_url=None,
        telemetry=telemetry.configuration(),
    )
    app.state.backend = backend
    app.add_middleware(Gate, settings=settings)
    app.add_middleware(Requests, durations=RequestDurations(backend.registry))
    problems.install(app)
    for module in (
        images,
        jobs,
        tracks,
        recipes,
        cameras,
        health,
        labels,
        label_folders,
        models,
        unsure,
        metrics,
        webhooks,
    ):
        app.include_router(module.router)
    viewer.mount(app)
    docs.mount(app)
    documents.describe(app)
    return app


def _assemble(settings: ServiceSettings) -> Backend:
    blobs = open_blobs(settings)
    queue = JobQueue(settings)
    observed = registry(queue)
    observed.register(DiskCollector(settings.blobs_dir, settings.disk_reserve_bytes))
    uploads = Uploads(settings, blobs)
    networks = NetworkStore.of(settings)
    return Backend(
        settings=settings,
        queue=queue,
        waiting=AsyncJobQueue(settings),
        blobs=blobs,
        networks=networks,
        unsure=UnsureStore.of(settings),
        uploads=uploads,
        submissions=Submissions(
            settings,
            uploads,
            validation.limiter(),
            ForegroundNames(queue.foreground_networks, networks),
        ),
        previews=Previews(),
        registry=observed,
        labels=LabelFolders(settings.labels_dir),
        exports=LabelExports(),
        tracks=Tracks(settings),
        keys=KeyRing(settings.api_key_hashes, settings.api_keys_file),
    )


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    backend: Backend = app.state.backend
    limit_connections(backend.settings.max_connections)
    with suppress(redis.RedisError, OSError):
        await to_thread.run_sync(backend.queue.claim_blobs)
    tasks = [asyncio.create_task(_reap_forever(backend.queue))]
    if not backend.settings.has_keys:
        tasks.append(asyncio.create_task(_stop_if_exposed()))
    gc.collect()
    gc.freeze()  # the application itself is no garbage: looking through it held requests up
    yield
    for task in tasks:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
    await backend.waiting.close()
    await backend.tracks.close()
    await to_thread.run_sync(backend.queue.close)


async def _stop_if_exposed() -> None:
    """End a server that listens to a network although there are no keys; by then it has begun to
    listen."""
    await asyncio.sleep(_LISTENS_AFTER_S)
    if addresses := exposed():
        log.error("refusing to listen to a network without API keys", addresses=addresses)
        signal.raise_signal(signal.SIGTERM)


async def _reap_forever(queue: JobQueue) -> None:
    """Workers do this as well; with the last of them gone, nobody else would say that its job is
    lost."""
    while True:
        await asyncio.sleep(_REAP_EVERY_S)
        with suppress(redis.RedisError, OSError):  # /readyz names it
            await to_thread.run_sync(queue.reap)
            await to_thread.run_sync(queue.claim_blobs)
