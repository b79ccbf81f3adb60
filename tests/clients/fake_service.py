"""A small stand-in for the service: serves the viewer's files and answers with what a test
prepared."""

from __future__ import annotations

import asyncio
import hashlib
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import uvicorn
from dlo_client.contracts import AnyJob, ImageInfo, JobEvent, JobState, Problem
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from services.page_frame import document
from tests.clients import samples

VIEWER = Path(__file__).parents[2] / "services" / "viewer"


class FakeService:
    """Every submitted job ends as ``finished``; with ``slow`` only the second look sees its end."""

    def __init__(self) -> None:
        self.finished: AnyJob = samples.instances_job()
        self.unsure: dict[str, bytes] = {}
        """Pictures that the service keeps because it was unsure of them."""
        self.next: list[AnyJob] = []
        """Answers to the next submissions, before those are ``finished``."""
        self.of_picture: dict[str, AnyJob] = {}
        """Answers by the names of pictures: those that are sent together come in any order."""
        self.file = samples.OVERLAY
        self.preview: bytes | None = None
        """Of every uploaded picture; without one no picture can be decoded."""
        self.refusal: Problem | None = None
        self.slow = False
        self.requests: list[str] = []
        self.parts: list[list[str]] = []
        self.keys: list[str | None] = []
        self.cancelled = threading.Event()
        self.held: threading.Event | None = None
        """If there is one: submissions are answered when it is set."""

    def app(self) -> Starlette:
        return Starlette(
            routes=[
                Route("/", lambda _: HTMLResponse(document("index", "./"))),
                Route(
                    "/viewer/{name}.html",
                    lambda request: HTMLResponse(document(request.path_params["name"])),
                ),
                Route("/v1/models", self._networks),
                Route("/v1/unsure", lambda _: JSONResponse([{"id": key} for key in self.unsure])),
                Route(
                    "/v1/unsure/{id}",
                    lambda request: Response(self.unsure[request.path_params["id"]]),
                ),
                Route("/v1/label-folders", lambda _: JSONResponse({"folders": []})),
                Route("/v1/images", self._upload, methods=["POST"]),
                Route(
                    "/v1/images/{id}/preview",
                    lambda _: Response(self.preview, media_type="image/png"),
                ),
                Route("/v1/jobs", self._submit, methods=["POST"]),
                Route("/v1/jobs/{id}", self._job),
                Route("/v1/jobs/{id}", self._cancel, methods=["DELETE"]),
                Route("/v1/jobs/{id}/events", self._events),
                Route("/v1/jobs/{id}/files/{name}", lambda _: Response(self.file)),
                Route("/v1/tracks", lambda _: JSONResponse({"id": "1"}, 201), methods=["POST"]),
                Route("/v1/tracks/1", lambda _: Response(status_code=204), methods=["DELETE"]),
                Route("/v1/tracks/1/frames", self._frame, methods=["POST"]),
                Mount("/viewer", StaticFiles(directory=VIEWER)),
            ]
        )

    async def _upload(self, request: Request) -> Response:
        digest = hashlib.sha256(await request.body()).hexdigest()
        if self.preview is None:
            problem = samples.refused(422, code="invalid_image")
            return Response(problem.model_dump_json(), 422, media_type="application/problem+json")
        info = ImageInfo(
            id=digest, sha256=digest, width=samples.WIDTH, height=samples.HEIGHT, bytes=1
        )
        return Response(info.model_dump_json(), 201, media_type="application/json")

    async def _submit(self, request: Request) -> Response:
        self.keys.append(request.headers.get("Authorization"))
        async with request.form() as form:
            self.requests.append(str(form["request"]))
            self.parts.append([name for name in form if name != "request"])
            named = self.of_picture.get(getattr(form.get("image"), "filename", None) or "")
        if self.held is not None:
            await asyncio.to_thread(self.held.wait, 60)
        if self.refusal is not None:
            body = self.refusal.model_dump_json()
            return Response(body, self.refusal.status, media_type="application/problem+json")
        if self.slow:
            return _json(samples.job(JobState.RUNNING, kind="instances"))
        return _json(named or (self.next.pop(0) if self.next else self.finished))

    def _job(self, _: Request) -> Response:
        """A slow job ends when it is cancelled; as in the real service the look waits for that."""
        if self.slow and self.cancelled.wait(timeout=60):
            return _json(samples.job(JobState.CANCELLED, kind="instances"))
        return _json(self.finished)

    def _events(self, _: Request) -> Response:
        """As server-sent events: half done, and then how it ends."""
        if not self.slow:
            return Response(_event(JobState.SUCCEEDED, 1.0), media_type="text/event-stream")

        def both() -> Iterator[str]:
            yield _event(JobState.RUNNING, 0.5)
            if self.cancelled.wait(timeout=60):
                yield _event(JobState.CANCELLED, 1.0)

        return StreamingResponse(both(), media_type="text/event-stream")

    def _cancel(self, _: Request) -> Response:
        self.cancelled.set()
        return _json(samples.job(JobState.CANCELLED, kind="instances"))

    async def _frame(self, request: Request) -> Response:
        """The two cables of the samples; the second is covered from the second frame on."""
        self.requests.append(request.query_params["time_s"])
        states = ("seen", "seen" if len(self.requests) == 1 else "partly_covered")
        cables = [
            {
                "id": item.id,
                "state": state,
                "certainty": 0.9,
                "centerline_xy": item.centerline_xy,
                "covered": [],
            }
            for item, state in zip(samples.two_cables().instances, states, strict=True)
        ]
        return JSONResponse(
            {"frame": len(self.requests), "time_s": 0.0, "cables": cables, "crossings": []}
        )

    def _networks(self, _: Request) -> Response:
        orientation = samples.network().model_copy(
            update={"name": "orientation", "task": "orientation"}
        )
        networks = [samples.network(), orientation]
        return JSONResponse([network.model_dump(mode="json") for network in networks])


def _event(state: JobState, progress: float) -> str:
    return f"data: {JobEvent(id='1-0', state=state, progress=progress).model_dump_json()}\n\n"


def _json(job: AnyJob) -> Response:
    return Response(job.model_dump_json(), media_type="application/json")


_USED: set[int] = set()
"""Ports of the services so far: what a page keeps in the browser belongs to its port, and the system
gives one again now and then."""


def _free_port() -> int:
    while True:
        with socket.socket() as tried:
            tried.bind(("127.0.0.1", 0))
            port = int(tried.getsockname()[1])
        if port not in _USED:
            _USED.add(port)
            return port


@contextmanager
def served(app: Starlette) -> Iterator[str]:
    """``app`` on a free port of this machine; gives its address."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", _free_port()))
        listener.listen()  # who comes before the server runs waits
        server = uvicorn.Server(uvicorn.Config(app, log_level="warning", lifespan="off"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join(timeout=10)
