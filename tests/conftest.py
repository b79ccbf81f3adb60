"""A real queue server for each process that runs tests, and real workers on request."""

from __future__ import annotations

import gc
from collections.abc import Callable, Generator, Iterator
from itertools import count

import httpx
import pytest
import redis

from tests.processes import WorkerProcess
from workers.embedded import EmbeddedQueue
from workers.queue import JobQueue
from workers.settings import Settings

pytest_plugins = ["tests.needed", "tests.browser"]


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is imported for tests is no garbage: to look through it took a quarter of the time of
    importing it, and a twentieth of that of tests."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def valkey_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of an embedded queue server that all tests of this process share."""
    with EmbeddedQueue(tmp_path_factory.mktemp("queue")) as server:
        yield server.url


@pytest.fixture(scope="session")
def s3_address() -> Iterator[str]:
    """Of a real S3 server in this process."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def s3(s3_address, monkeypatch) -> None:
    """The environment of a process that may use an empty bucket ``pictures``."""
    import boto3

    names = {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    for name, value in (names | {"AWS_ENDPOINT_URL_S3": s3_address}).items():
        monkeypatch.setenv(name, value)
    httpx.post(f"{s3_address}/moto-api/reset")
    boto3.client("s3").create_bucket(Bucket="pictures")


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
