"""A queue server behind a password and TLS."""

from __future__ import annotations

import asyncio
import socket
import ssl
import threading
from contextlib import closing
from urllib.parse import urlsplit

import pytest
import redis
import trustme
from dlo_client.contracts import NoopRequest
from redis.backoff import NoBackoff

from workers.async_queue import AsyncJobQueue
from workers.connection import Patience, connect
from workers.queue import JobQueue


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture
def tls_port(settings, authority):
    """Speaks TLS, and hands what comes on to the queue server: the embedded one has no TLS of its
    own."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("127.0.0.1").configure_cert(context)
    inner = urlsplit(settings.redis_url).port
    loop = asyncio.new_event_loop()

    async def serve(reader, writer):
        there_reader, there_writer = await asyncio.open_connection("127.0.0.1", inner)
        await asyncio.gather(_pump(reader, there_writer), _pump(there_reader, writer))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        loop.run_until_complete(asyncio.start_server(serve, sock=listener, ssl=context))
        thread = threading.Thread(target=loop.run_forever, daemon=True)
        thread.start()
        yield listener.getsockname()[1]
        loop.call_soon_threadsafe(loop.stop)
        thread.join()


async def _pump(reader, writer):
    try:
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    except (ConnectionError, ssl.SSLError):
        pass
    writer.close()


@pytest.fixture
def guarded(settings, tls_port, authority, tmp_path):
    """Settings that name the password and the authority in files."""
    (tmp_path / "password").write_text(f"{urlsplit(settings.redis_url).password}\n")
    authority.cert_pem.write_to_path(tmp_path / "ca.pem")
    return settings.model_copy(
        update={
            "redis_url": f"rediss://127.0.0.1:{tls_port}/0",
            "redis_password_file": tmp_path / "password",
            "redis_ca_file": tmp_path / "ca.pem",
        }
    )


def test_jobs_go_through_tls_with_the_password_of_a_file(guarded):
    with closing(JobQueue(guarded)) as queue:
        job, _ = queue.submit(NoopRequest())
        assert queue.ping()

        async def look():
            waiting = AsyncJobQueue(guarded)
            record = await waiting.get(job.id)
            await waiting.close()
            return record.job

        assert asyncio.run(look()) == job


def test_a_server_of_another_authority_is_not_believed(guarded, tmp_path):
    trustme.CA().cert_pem.write_to_path(tmp_path / "ca.pem")
    with (
        closing(JobQueue(guarded)) as queue,
        pytest.raises(redis.ConnectionError, match="certificate"),
    ):
        queue.depth()


def test_a_wrong_password_is_refused(guarded, tmp_path):
    (tmp_path / "password").write_text("guess")
    with closing(JobQueue(guarded)) as queue, pytest.raises(redis.AuthenticationError):
        queue.depth()


def test_passwords_are_in_no_representation_of_the_settings(settings):
    assert urlsplit(settings.redis_url).password not in repr(settings)


class TestPatience:
    """A worker ended, again and again, while the disk of the queue server was full."""

    @staticmethod
    def answers(*errors: Exception):
        left = list(errors)

        def do():
            if left:
                raise left.pop(0)
            return "answer"

        return do

    def test_a_server_that_cannot_write_is_waited_for(self):
        full = redis.ResponseError(
            "MISCONF Errors writing to the AOF file: No space left on device"
        )
        in_pipeline = redis.ResponseError(
            "Command # 1 (SADD x y) of pipeline caused error: MISCONF Errors writing"
        )
        patience = Patience(NoBackoff(), -1)
        assert (
            patience.call_with_retry(self.answers(full, in_pipeline, full), lambda _: None)
            == "answer"
        )

    def test_a_server_whose_memory_is_full_is_waited_for(self, settings):
        with connect(settings, patient=True) as patient, connect(settings) as impatient:
            impatient.config_set("maxmemory", 1)
            freed = threading.Timer(0.3, lambda: impatient.config_set("maxmemory", 0))
            try:
                with pytest.raises(redis.ResponseError):
                    impatient.set("key", "value")
                freed.start()
                assert patient.set("key", "value")
            finally:
                freed.join()
                impatient.config_set("maxmemory", 0)

    def test_other_refusals_are_errors(self):
        with pytest.raises(redis.ResponseError, match="WRONGTYPE"):
            Patience(NoBackoff(), -1).call_with_retry(
                self.answers(redis.ResponseError("WRONGTYPE")), lambda _: None
            )

    def test_workers_have_it_and_the_service_does_not(self, settings):
        with connect(settings, patient=True) as patient, connect(settings) as impatient:
            assert isinstance(patient.get_retry(), Patience)
            assert not isinstance(impatient.get_retry(), Patience)
