"""A small stand-in for the service: serves the viewer's files and answers with what a test prepared."""

from __future__ import annotations

import hashlib
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import uvicorn
from dlo_client.contracts import AnyJob, ImageInfo, JobState, Problem
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from tests.clients import samples

VIEWER = Path(__file__).parents[2] / "services" / "viewer"


class FakeService:
    """Every submitted job ends as ``finished``; with ``slow`` only the second look sees its end."""

    def __init__(self) -> None:
        self.finished: AnyJob = samples.instances_job()
        self.file = samples.OVERLAY
        self.preview: bytes | None = None
        """Of every uploaded picture; without one no picture can be decoded."""
        self.refusal: Problem | None = None
        self.slow = False
        self.requests: list[str] = []
        self.parts: list[list[str]] = []
        self.keys: list[str | None] = []
        self.cancelled = threading.Event()

    def app(self) -> Starlette:
        return Starlette(
            routes=[
                Route("/", lambda _: FileResponse(VIEWER / "index.html")),
                Route("/v1/models", self._networks),
                Route("/v1/images", self._upload, methods=["POST"]),
                Route("/v1/images/{id}/preview", lambda _: Response(self.preview, media_type="image/png")),
                Route("/v1/jobs", self._submit, methods=["POST"]),
                Route("/v1/jobs/{id}", self._job),
                Route("/v1/jobs/{id}", self._cancel, methods=["DELETE"]),
                Route("/v1/jobs/{id}/files/{name}", lambda _: Response(self.file)),
                Mount("/viewer", StaticFiles(directory=VIEWER)),
            ]
        )

    async def _upload(self, request: Request) -> Response:
        digest = hashlib.sha256(await request.body()).hexdigest()
        if self.preview is None:
            problem = samples.refused(422, code="invalid_image")
            return Response(problem.model_dump_json(), 422, media_type="application/problem+json")
        info = ImageInfo(id=digest, sha256=digest, width=samples.WIDTH, height=samples.HEIGHT, bytes=1)
        return Response(info.model_dump_json(), 201, media_type="application/json")

    async def _submit(self, request: Request) -> Response:
        self.keys.append(request.headers.get("Authorization"))
        async with request.form() as form:
            self.requests.append(str(form["request"]))
            self.parts.append([name for name in form if name != "request"])
        if self.refusal is not None:
            body = self.refusal.model_dump_json()
            return Response(body, self.refusal.status, media_type="application/problem+json")
        return _json(samples.job(JobState.RUNNING, kind="instances") if self.slow else self.finished)

    def _job(self, _: Request) -> Response:
        """A slow job ends when it is cancelled; as in the real service the look waits for that."""
        if self.slow and self.cancelled.wait(timeout=10):
            return _json(samples.job(JobState.CANCELLED, kind="instances"))
        return _json(self.finished)

    def _cancel(self, _: Request) -> Response:
        self.cancelled.set()
        return _json(samples.job(JobState.CANCELLED, kind="instances"))

    def _networks(self, _: Request) -> Response:
        orientation = samples.network().model_copy(update={"name": "orientation", "task": "orientation"})
        networks = [samples.network(), orientation]
        return JSONResponse([network.model_dump(mode="json") for network in networks])


def _json(job: AnyJob) -> Response:
    return Response(job.model_dump_json(), media_type="application/json")


@contextmanager
def served(app: Starlette) -> Iterator[str]:
    """``app`` on a free port of this machine; gives its address."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", lifespan="off"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join(timeout=10)
