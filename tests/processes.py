"""Real processes for tests: start a worker, wait for a condition, put everything away again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from workers.keys import Keys
from workers.queue import JobQueue, WorkerInfo
from workers.settings import Settings

ROOT = Path(__file__).parent.parent
ONE_CHILD = {"DLO_SPARE_CHILD": "false"}
"""For :func:`running_service`: without the second warm child of each worker, whose networks take
seconds of a core to load, where no test is about it."""
KEYS = Keys("dlo")
"""Of the deployment that settings are of by default."""
T = TypeVar("T")


def wait_until(condition: Callable[[], T], timeout_s: float = 120.0) -> T:
    """The first true value of ``condition``; AssertionError if there is none in time."""
    give_up = time.monotonic() + timeout_s
    while not (value := condition()):
        assert time.monotonic() < give_up, f"waited {timeout_s:g} s in vain"
        time.sleep(0.02)
    return value


def environment(settings: Settings) -> dict[str, str]:
    """Of a process that is to have these settings."""
    values = settings.model_dump(
        mode="json", exclude_none=True, exclude={"onnx_providers", "webhook_hosts"}
    )
    return os.environ | {f"DLO_{name.upper()}": str(value) for name, value in values.items()}


@contextmanager
def running_service(
    data_dir: Path, workers: int, more: Mapping[str, str] | None = None
) -> Iterator[str]:
    """``python -m services`` with its own queue and workers, ready; its address. Stopped at the
    end.

    ``more``: further variables.
    """
    settings = {name: value for name, value in os.environ.items() if not name.startswith("DLO_")}
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "services",
            "--port",
            "0",
            "--workers",
            str(workers),
            "--data-dir",
            str(data_dir),
        ],
        cwd=ROOT,
        env=settings | {"DLO_LOG_LEVEL": "WARNING"} | dict(more or {}),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        assert line.startswith("ready at "), line
        yield line.split()[-1]
    finally:
        process.terminate()
        try:
            process.wait(timeout=60)
        finally:
            process.kill()
            process.stdout.close()


class WorkerProcess:
    """A worker as a child of the test; by default it loads no networks, see
    :mod:`tests.noop_worker`."""

    def __init__(self, settings: Settings, name: str, module: str = "tests.noop_worker") -> None:
        self._name = name
        self._queue = JobQueue(settings)
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, "--name", name, "--with-parent", str(os.getpid())],
            cwd=ROOT,
            env=environment(settings),
        )

    def info(self) -> WorkerInfo | None:
        """What it says of itself, while it lives."""
        return next(
            (worker for worker in self._queue.workers() if worker.name.startswith(self._name)), None
        )

    def wait_ready(self) -> None:
        def ready() -> bool:
            assert self.process.poll() is None, "the worker ended"
            info = self.info()
            return info is not None and info.ready

        wait_until(ready, 240.0)

    def child_pid(self) -> int:
        """Of its warm child."""
        (child,) = self.child_pids()
        return child

    def child_pids(self) -> list[int]:
        """Of its warm child and of the next one."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        return [int(pid) for pid in children.read_text().split()]

    def kill(self) -> None:
        """As the out-of-memory killer does it; the kernel takes the child along."""
        self.process.kill()
        self.process.wait()

    def stop(self, timeout_s: float = 60.0) -> int:
        """SIGTERM; its exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout_s)

    def close(self) -> None:
        if self.process.poll() is None:
            try:
                self.stop()
            except subprocess.TimeoutExpired:
                self.kill()
        self._queue.close()
