"""A real queue server for each process that runs tests, and real workers on request."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count

import pytest
import redis

from tests.processes import WorkerProcess
from workers.embedded import EmbeddedQueue
from workers.queue import JobQueue
from workers.settings import Settings

pytest_plugins = ["tests.needed"]


@pytest.fixture(scope="session")
def valkey_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of an embedded queue server that all tests of this process share."""
    with EmbeddedQueue(tmp_path_factory.mktemp("queue")) as server:
        yield server.url


@pytest.fixture
def settings(valkey_url, tmp_path) -> Settings:
    """For a queue that is empty and a blob folder that is new."""
    with redis.Redis.from_url(valkey_url) as client:
        client.flushall()
    return Settings(redis_url=valkey_url, data_dir=tmp_path / "data", spare_child=False)


@pytest.fixture
def job_queue(settings) -> Iterator[JobQueue]:
    queue = JobQueue(settings)
    yield queue
    queue.close()


@pytest.fixture
def start_worker(settings) -> Iterator[Callable[..., WorkerProcess]]:
    """Starts a worker, by default with ``settings``, and waits until it is ready."""
    started: list[WorkerProcess] = []
    numbers = count(1)

    def start(with_settings: Settings = settings, *, wait: bool = True) -> WorkerProcess:
        worker = WorkerProcess(with_settings, f"worker{next(numbers)}")
        started.append(worker)
        if wait:
            worker.wait_ready()
        return worker

    yield start
    for worker in started:
        worker.close()
