"""A whole service in parts that can be killed one by one: queue server, workers, HTTP."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil

from tests.processes import ROOT, environment, wait_until
from workers.embedded import EmbeddedQueue, free_port
from workers.queue import JobQueue
from workers.settings import Settings

KINDS = ("child", "worker", "api", "queue")
"""What can be killed."""

_READY_WITHIN_S = 600.0
_SETTLED_S, _STILL_MB = 2.0, 2.0

_UVICORN = """
import signal, sys
from workers.lifeline import die_with_parent
die_with_parent(signal.SIGKILL, int(sys.argv.pop(1)))
from uvicorn.main import main
main()
"""


class Part:
    """A process that is started again whenever it is gone and :meth:`tend` is called, as a
    supervisor does it."""

    def __init__(self, command: list[str], env: dict[str, str]) -> None:
        self._command, self._env = command, env
        self.process = self._start()
        self.wanted = True

    def tend(self) -> None:
        if self.wanted and self.process.poll() is not None:
            self.process = self._start()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        self.wanted = False
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(10)
        self.process.kill()
        self.process.wait()

    def _start(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(self._command, cwd=ROOT, env=self._env, stdin=subprocess.DEVNULL)


class Plant:
    """Usable as a context manager; ``folder`` holds everything that it writes."""

    def __init__(
        self, folder: Path, workers: int = 1, env: dict[str, str] | None = None, **changes: object
    ) -> None:
        self.folder = folder
        self.queue_server = EmbeddedQueue(folder / "queue").start()
        plain = {"log_level": "ERROR", "disk_reserve_bytes": 0, "spare_child": False} | changes
        self.settings = Settings(redis_url=self.queue_server.url, data_dir=folder / "data", **plain)
        self._why_not = ""
        self._port = free_port()
        self.url = f"http://127.0.0.1:{self._port}"
        base = environment(self.settings) | {"PYTHONPATH": f"{ROOT}:{ROOT / 'clients/python'}"}
        base.pop("PYTHONDONTWRITEBYTECODE", None)  # every child would compile all modules again
        self._env = base | (env or {})
        self.api = Part(self._api_command(), self._env)
        worker = [sys.executable, "-m", "workers", "--with-parent", str(os.getpid()), "--name"]
        self.workers = [Part([*worker, f"w{k}"], self._env) for k in range(workers)]
        self.queue = JobQueue(self.settings)

    def __enter__(self) -> Plant:
        try:
            wait_until(self.ready, _READY_WITHIN_S)
        except AssertionError:
            self.__exit__()
            raise AssertionError(
                f"not ready within {_READY_WITHIN_S:g} s: {self._why_not}"
            ) from None
        return self

    def __exit__(self, *exc: object) -> None:
        for part in (self.api, *self.workers):
            part.stop()
        self.queue.close()
        self.queue_server.stop()

    def ready(self) -> bool:
        """Whether ``/readyz`` is; starts again what has ended."""
        self.tend()
        try:
            answer = httpx.get(f"{self.url}/readyz", timeout=5)
        except httpx.HTTPError as error:
            self._why_not = str(error)
            return False
        self._why_not = answer.text
        return answer.status_code == 200

    def tend(self) -> None:
        for part in (self.api, *self.workers):
            part.tend()

    def kill(self, what: str, chance: random.Random) -> None:
        """SIGKILL one of :data:`KINDS`; the queue server is started again on its data."""
        match what:
            case "child":
                if children := psutil.Process(chance.choice(self.workers).process.pid).children():
                    with contextlib.suppress(psutil.NoSuchProcess):
                        os.kill(chance.choice(children).pid, signal.SIGKILL)
            case "worker":
                chance.choice(self.workers).kill()
            case "api":
                self.api.kill()
            case "queue":
                self.queue_server.kill()
                self.queue_server.start()

    def cut_power(self) -> None:
        """SIGKILL of everything."""
        for part in (self.api, *self.workers):
            part.process.kill()
        self.queue_server.kill()
        for part in (self.api, *self.workers):
            part.process.wait()

    def power_on(self) -> None:
        """Start everything again."""
        self.queue_server.start()
        self.tend()

    def memory_mb(self) -> dict[str, float]:
        """Resident, by part, with all children."""
        parts = {"api": self.api.process.pid}
        parts |= {f"worker {k}": worker.process.pid for k, worker in enumerate(self.workers)}
        found = {}
        for name, pid in parts.items():
            with contextlib.suppress(psutil.NoSuchProcess):
                process = psutil.Process(pid)
                family = [process, *process.children(recursive=True)]
                found[name] = sum(one.memory_info().rss for one in family) / 2**20
        return found

    def settled_mb(self) -> float:
        """Memory of all parts once every child that should be there is loaded: it no longer
        grows."""
        children = len(self.workers) * (2 if self.settings.spare_child else 1)

        def settled() -> float | None:
            before = self.memory_mb()
            time.sleep(_SETTLED_S)
            self.tend()
            there = sum(
                len(psutil.Process(worker.process.pid).children()) for worker in self.workers
            )
            now = sum(self.memory_mb().values())
            return (
                now if there == children and abs(now - sum(before.values())) < _STILL_MB else None
            )

        return wait_until(settled, _READY_WITHIN_S)

    def processor_s(self) -> float:
        """Processor time of everything that runs now, in seconds."""
        tops = [
            self.api.process.pid,
            self.queue_server.pid,
            *(worker.process.pid for worker in self.workers),
        ]
        family = [
            one
            for pid in tops
            for one in (psutil.Process(pid), *psutil.Process(pid).children(recursive=True))
        ]
        return sum(sum(one.cpu_times()[:2]) for one in family)

    def _api_command(self) -> list[str]:
        where = ["--host", "127.0.0.1", "--port", str(self._port), "--log-level", "error"]
        http = ["--http", "services.http_protocol:BoundedHttp"]
        return [
            sys.executable,
            "-c",
            _UVICORN,
            str(os.getpid()),
            "--factory",
            "services.app:create_app",
            *where,
            *http,
        ]


@contextlib.contextmanager
def plant(
    workers: int = 1, env: dict[str, str] | None = None, **changes: object
) -> Iterator[Plant]:
    """A plant in a folder of its own that is gone afterwards."""
    folder = Path(tempfile.mkdtemp(prefix="plant-"))
    try:
        with Plant(folder, workers, env, **changes) as running:
            yield running
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def seconds(started: float) -> float:
    return round(time.monotonic() - started, 2)
