"""Webhooks from the end of a job to a real receiver: signed, repeated, given up."""

from __future__ import annotations

import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from dlo_client.contracts import JobState, NoopRequest, NoopResult
from dlo_client.errors import UnexpectedReply
from dlo_client.webhooks import read_webhook

from workers import webhooks
from workers.connection import connect
from workers.ledger import Ledger
from workers.record import WEBHOOKS, job_key
from workers.settings import Settings
from workers.webhooks import Courier

SECRET = "a secret of some length"


class Receiver:
    """An HTTP server that keeps what it is sent and answers ``status``."""

    def __init__(self) -> None:
        self.status = 204
        self.calls: list[tuple[dict[str, str], bytes]] = []
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                receiver.calls.append((dict(self.headers), body))
                self.send_response(receiver.status)
                self.send_header("Location", "/elsewhere")
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/hook"


@pytest.fixture
def receiver():
    receiver = Receiver()
    thread = threading.Thread(target=receiver.server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield receiver
    receiver.server.shutdown()
    receiver.server.server_close()
    thread.join()


@pytest.fixture
def client(settings):
    with connect(settings) as client:
        yield client


@pytest.fixture
def courier(client, settings):
    return Courier(client, settings.model_copy(update={"webhook_secret": SECRET}))


@pytest.fixture
def end(job_queue, client, settings):
    """Submits a job with a webhook and ends it as a worker would; its id."""

    def end(url: str) -> str:
        job_id = job_queue.submit(NoopRequest(webhook_url=url))[0].id
        ledger = Ledger(client, settings)
        assert ledger.succeed(ledger.claim(job_id, "w"), NoopResult(held_s=0.25), [], {})
        return job_id

    return end


def make_due(client, job_id):
    client.zadd(WEBHOOKS, {job_id: 0})


def test_the_ended_job_arrives_signed_and_once(receiver, courier, end, job_queue):
    job_id = end(receiver.url)
    assert courier.deliver() == 1
    assert courier.deliver() == 0
    ((headers, body),) = receiver.calls
    job = read_webhook(body, headers["DLO-Signature"], SECRET)
    assert job == job_queue.get(job_id)
    assert job.state is JobState.SUCCEEDED
    assert job.result.held_s == 0.25
    assert headers["DLO-Job"] == job_id


def test_a_cancelled_job_is_told_of_too(receiver, courier, job_queue):
    job_id = job_queue.submit(NoopRequest(webhook_url=receiver.url))[0].id
    assert courier.deliver() == 0
    job_queue.cancel(job_id)
    assert courier.deliver() == 1
    headers, body = receiver.calls[0]
    assert read_webhook(body, headers["DLO-Signature"], SECRET).state is JobState.CANCELLED


def test_a_job_without_a_webhook_is_not_told_of(courier, job_queue, client):
    job_queue.cancel(job_queue.submit(NoopRequest())[0].id)
    assert client.zcard(WEBHOOKS) == 0


@pytest.mark.parametrize("status", [500, 404, 302])
def test_what_is_not_heard_is_tried_again_later(receiver, courier, end, client, status):
    receiver.status = status
    job_id = end(receiver.url)
    assert courier.deliver() == 0
    assert len(receiver.calls) == 1
    assert courier.deliver() == 0
    assert len(receiver.calls) == 1, "not before its time, and no redirect is followed"
    assert client.zscore(WEBHOOKS, job_id) == pytest.approx(time.time() + webhooks.DELAYS_S[0], abs=1.5)
    receiver.status = 200
    make_due(client, job_id)
    assert courier.deliver() == 1
    assert receiver.calls[1][0]["DLO-Attempt"] == "2"


def test_it_is_given_up_in_the_end(receiver, courier, end, client):
    receiver.status = 503
    job_id = end(receiver.url)
    for _ in range(20):
        courier.deliver()
        if client.zscore(WEBHOOKS, job_id) is None:
            break
        make_due(client, job_id)
    assert len(receiver.calls) == 1 + len(webhooks.DELAYS_S)
    assert client.ttl(job_key(job_id)) > 0, "the record still expires"


def test_nobody_listens(courier, end, receiver):
    receiver.server.server_close()
    end(receiver.url)
    assert courier.deliver() == 0


def test_a_courier_that_dies_is_followed_by_another(receiver, courier, end, client):
    """Taken, but not delivered: due again when the lease is over, not before."""
    job_id = end(receiver.url)
    assert courier._take(args=[60_000]) == job_id
    assert courier.deliver() == 0
    make_due(client, job_id)
    assert courier.deliver() == 1


def test_a_job_that_has_expired_is_forgotten(courier, end, client, receiver):
    job_id = end(receiver.url)
    client.delete(job_key(job_id))
    assert courier.deliver() == 0
    assert client.zcard(WEBHOOKS) == 0
    assert receiver.calls == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body, mark: (body + b" ", mark), "not of this secret"),
        (lambda body, mark: (body, mark.replace("v1=", "v2=")), "no DLO-Signature"),
        (lambda body, mark: (b"{}", webhooks.signature(SECRET, int(time.time()), b"{}")), "no job"),
        (lambda body, mark: (body, webhooks.signature(SECRET, int(time.time()) - 1000, body)), "too old"),
        (lambda body, mark: (body, webhooks.signature("another", int(time.time()), body)), "not of this secret"),
    ],
)
def test_a_forged_webhook_is_refused(receiver, courier, end, change, said):
    end(receiver.url)
    courier.deliver()
    headers, body = receiver.calls[0]
    body, mark = change(body, headers["DLO-Signature"])
    with pytest.raises(UnexpectedReply, match=said):
        read_webhook(body, mark, SECRET)


def test_a_worker_delivers(settings, start_worker, job_queue, receiver):
    with_secret = settings.model_copy(update={"webhook_secret": SECRET})
    start_worker(with_secret)
    job_queue.submit(NoopRequest(webhook_url=receiver.url))
    deadline = time.monotonic() + 20
    while not receiver.calls and time.monotonic() < deadline:
        time.sleep(0.05)
    headers, body = receiver.calls[0]
    assert read_webhook(body, headers["DLO-Signature"], SECRET).state is JobState.SUCCEEDED


def test_hosts_need_a_secret(monkeypatch):
    monkeypatch.setenv("DLO_WEBHOOK_HOSTS", "cell.example, plc:8080")
    with pytest.raises(ValueError, match="DLO_WEBHOOK_SECRET"):
        Settings()
    monkeypatch.setenv("DLO_WEBHOOK_SECRET", SECRET)
    assert Settings().webhook_hosts == ("cell.example", "plc:8080")
    assert SECRET not in repr(Settings())
