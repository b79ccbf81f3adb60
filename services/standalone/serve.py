"""The whole service on one machine: the queue server, workers and HTTP, from one command to one
shutdown."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import secrets
import shutil
import signal
import socket
import sys
from collections.abc import Coroutine, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import uvicorn
from uvicorn.loops.auto import auto_loop_factory

from services.app import create_app
from services.http_protocol import BoundedHttp
from services.readiness import hindrance
from services.settings import ServiceSettings
from services.standalone.supervised import Child
from workers import embedded
from workers.queue import JobQueue
from workers.record import TRAINING

_READY_WITHIN_S = 120.0
_POLL_S = 0.1
_HTTP_GRACE_S = 3
_COMMAND_GRACE_S = 5.0
_WORKER_GRACE_S = 5.0
_QUEUE_GRACE_S = 10.0
_INTERRUPTED = 130


class CannotServeError(Exception):
    """The service cannot start here; the message is for the one who started it."""


def serve(settings: ServiceSettings, then: Sequence[str] = ()) -> int:
    """Serve until a signal, or run the command ``then`` once ready and stop after it; return the
    exit code.

    Without a ``redis_url`` of its own the service starts a queue server whose data is in the data
    folder.

    Raises: CannotServeError: the port is taken, another service works on the data folder, or
        ``then`` is no command.
    """
    if then and not shutil.which(then[0]):
        raise CannotServeError(f"{then[0]} is no command")
    with contextlib.ExitStack() as held:
        listener = held.enter_context(_listen(settings.host, settings.port))
        if "redis_url" in settings.model_fields_set:
            return _run(_Service(settings, listener, queue_port=None).run(then))
        held.enter_context(_lock(settings.data_dir))
        queue_port, password = embedded.free_port(), secrets.token_urlsafe(24)
        settings = settings.model_copy(update={"redis_url": embedded.url(queue_port, password)})
        return _run(_Service(settings, listener, queue_port, password).run(then))


def _run(service: Coroutine[Any, Any, int]) -> int:
    """On the event loop that ``uvicorn`` takes when it is started by itself: the fastest one that
    is installed."""
    with asyncio.Runner(loop_factory=auto_loop_factory()) as runner:
        return runner.run(service)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With its protocol named, or asyncio leaves Nagle's algorithm on: 40 ms for every answer.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()  # now, so that nobody is refused between "ready" and the first accept
    except OSError as error:
        listener.close()
        raise CannotServeError(f"cannot listen on {host}:{port}: {error.strerror}") from error
    return listener


@contextmanager
def _lock(data_dir: Path) -> Iterator[None]:
    """Hold the data folder: two queue servers on one folder would destroy each other's data."""
    data_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    with (data_dir / "serve.lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            message = f"another service works on the data folder {data_dir}; stop it or name another folder"
            raise CannotServeError(message) from None
        yield


class _Server(uvicorn.Server):
    """Leaves signals to :class:`_Service`, which has more to stop than this."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class _Service:
    """The processes of one service."""

    def __init__(
        self,
        settings: ServiceSettings,
        listener: socket.socket,
        queue_port: int | None,
        password: str = "",
    ) -> None:
        self._settings = settings
        self._listener = listener
        self._url = _url(settings.host, listener)
        self._queue_port = queue_port
        self._password = password

    async def run(self, then: Sequence[str]) -> int:
        stop = asyncio.Event()
        for sent in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(sent, stop.set)
        queue, workers = self._children()
        server = _Server(
            uvicorn.Config(
                create_app(self._settings),
                log_config=None,
                access_log=False,
                http=BoundedHttp,
                ws_max_size=self._settings.max_image_bytes,
                timeout_graceful_shutdown=_HTTP_GRACE_S,
            )
        )
        serving = asyncio.create_task(server.serve(sockets=[self._listener]))
        serving.add_done_callback(lambda _: stop.set())
        for child in (*queue, *workers):
            child.start()
        try:
            return await self._work(then, stop)
        finally:
            server.should_exit = True
            await serving
            await asyncio.gather(*(worker.stop(_WORKER_GRACE_S) for worker in workers))
            await asyncio.gather(*(child.stop(_QUEUE_GRACE_S) for child in queue))

    def _children(self) -> tuple[list[Child], list[Child]]:
        settings = self._settings
        environment = os.environ | {
            "DLO_REDIS_URL": settings.redis_url,
            "DLO_DATA_DIR": str(settings.data_dir),
            "DLO_WORKERS": str(settings.workers),
        }
        tie = ("--with-parent", str(os.getpid()))
        workers = [Child("workers", tie, environment) for _ in range(settings.workers)]
        training = (*tie, "--queues", TRAINING)
        workers += [
            Child("workers", training, environment) for _ in range(settings.training_workers)
        ]
        if self._queue_port is None:
            return [], workers
        place = ("--dir", str(settings.queue_dir), "--port", str(self._queue_port))
        with_password = environment | {embedded.PASSWORD: self._password}
        return [Child("workers.embedded", (*place, *tie), with_password)], workers

    async def _work(self, then: Sequence[str], stop: asyncio.Event) -> int:
        why_not = await self._until_ready(stop)
        if why_not:
            print(f"not ready in {_READY_WITHIN_S:g} s: {why_not}", file=sys.stderr)
            return 1
        if stop.is_set():
            return _INTERRUPTED if then else 0
        print(f"ready at {self._url}", flush=True)
        if then:
            return await self._run(then, stop)
        await stop.wait()
        return 0

    async def _until_ready(self, stop: asyncio.Event) -> str | None:
        """Wait until ready or told to stop; why it is not, if it takes too long."""
        queue = JobQueue(self._settings)
        why_not: str | None = "nothing has started"
        try:
            async with asyncio.timeout(_READY_WITHIN_S):
                while why_not and not stop.is_set():
                    why_not = await asyncio.to_thread(hindrance, queue)
                    await asyncio.sleep(_POLL_S if why_not else 0)
        except TimeoutError:
            return why_not
        finally:
            queue.close()
        return None

    async def _run(self, then: Sequence[str], stop: asyncio.Event) -> int:
        """Run the command with the service's address in ``DLO_URL``; its exit code."""
        process = await asyncio.create_subprocess_exec(
            *then, env=os.environ | {"DLO_URL": self._url}
        )
        ended = asyncio.create_task(process.wait())
        stopped = asyncio.create_task(stop.wait())
        await asyncio.wait({ended, stopped}, return_when=asyncio.FIRST_COMPLETED)
        stopped.cancel()
        if not ended.done():
            process.terminate()
            await asyncio.wait({ended}, timeout=_COMMAND_GRACE_S)
        if not ended.done():
            process.kill()
        code = await ended
        return code if code >= 0 else 128 - code


def _url(host: str, listener: socket.socket) -> str:
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{listener.getsockname()[1]}"
