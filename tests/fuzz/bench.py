"""The whole path: HTTP, queue server, a worker's work, HTTP again; and what must never come of
it."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import uvicorn
from dlo_client.contracts import AnyJob, JobState, Problem
from pydantic import TypeAdapter

from services.app import create_app
from services.http_protocol import BoundedHttp
from services.settings import ServiceSettings
from tests.processes import wait_until
from tests.properties.judging import Bench, check_finite
from workers import jobs
from workers.connection import connect
from workers.embedded import EmbeddedQueue
from workers.ledger import Ledger
from workers.repeater import Repeater

_JOB: TypeAdapter[AnyJob] = TypeAdapter(AnyJob)
_RENEW_S = 1.0
_REFUSALS = (400, 408, 409, 413, 415, 422, 429, 507)


class Whole:
    """Answers requests and does the jobs that come of them; usable by :func:`whole`."""

    def __init__(self, settings: ServiceSettings, client: httpx.Client, folder: Path) -> None:
        self.client = client
        self.stages = Bench(folder)
        self._ledger = Ledger(connect(settings), settings)

    def submit(self, body: bytes, kind: str = "application/json") -> str:
        """``refused``, or how the job ended; raises AssertionError for what must not be."""
        answer = self.client.post("/v1/jobs", content=body, headers={"Content-Type": kind})
        if answer.status_code != 202:
            return _refused(answer)
        return self._work(answer.json()["id"])

    def upload(self, data: bytes) -> str:
        """``refused``, or how a job about the picture ended."""
        answer = self.client.post("/v1/images", content=data)
        if answer.status_code != 201:
            return _refused(answer)
        image = {"id": answer.json()["id"]}
        return self.submit(json.dumps({"kind": "segment", "image": image}).encode())

    def with_pictures(self, kind: str, request: dict[str, Any]) -> dict[str, Any]:
        """The request with the ids of the pictures that it names."""
        filled: dict[str, Any] = self.stages._with_pictures({"kind": kind} | request)
        return filled

    def _work(self, job_id: str) -> str:
        claim = self._ledger.claim(job_id, "fuzz")
        if claim is not None:
            held = Repeater("renew", _RENEW_S, lambda: self._ledger.renew(claim, "fuzz"))
            held.start()  # as a worker does it: else the service gives a long job back to the queue
            jobs.run(claim, self._ledger, self.stages.tools)
            held.stop()
        answer = self.client.get(f"/v1/jobs/{job_id}")
        assert answer.status_code == 200, answer.text[:300]
        job = _JOB.validate_json(answer.content)
        assert job.state.final, job.state
        assert job.problem is None or job.problem.code not in ("internal", "invalid_numbers"), (
            job.problem
        )
        if job.state is JobState.SUCCEEDED:
            check_finite(answer.json()["result"], "result")
        return job.state.value if job.problem is None else job.problem.code


def _refused(answer: httpx.Response) -> str:
    assert answer.status_code in _REFUSALS, f"{answer.status_code}: {answer.text[:300]}"
    problem = Problem.model_validate_json(answer.content)
    assert len(answer.content) < 50_000, "an answer of more than 50 kB"
    assert problem.detail
    return f"refused {answer.status_code}"


@contextmanager
def whole(folder: Path) -> Iterator[Whole]:
    """In ``folder``, with a queue server of its own."""
    with EmbeddedQueue(folder / "queue") as server:
        settings = ServiceSettings(
            redis_url=server.url,
            data_dir=folder,
            max_queue_depth=100_000,
            result_ttl_s=60,
            disk_reserve_bytes=0,
        )
        with _served(settings) as address, httpx.Client(base_url=address, timeout=600) as client:
            yield Whole(settings, client, folder)


@contextmanager
def _served(settings: ServiceSettings) -> Iterator[str]:
    """The address of the application behind a server of this process."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        config = uvicorn.Config(
            create_app(settings), http=BoundedHttp, log_config=None, access_log=False
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        wait_until(lambda: server.started)
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        server.should_exit = True
        thread.join()
