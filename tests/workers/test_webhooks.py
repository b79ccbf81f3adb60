"""Webhooks from the end of a job to a real receiver: signed, repeated, given up."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from dlo_client.contracts import JobState, NoopRequest, NoopResult
from dlo_client.errors import UnexpectedReply
from dlo_client.webhooks import read_webhook

from tests.processes import KEYS, wait_until
from workers import webhooks
from workers.embedded import free_port
from workers.ledger import Ledger
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

        self.server = ThreadingHTTPServer(
            ("127.0.0.1", 0), Handler
        )  # its end waits for no connection
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
    client.zadd(KEYS.webhooks, {job_id: 0})


def test_the_ended_job_arrives_signed_and_once(receiver, courier, end, job_queue):
    job_id = end(receiver.url)
    assert courier.deliver() == 1
    assert courier.deliver() == 0
    ((headers, body),) = receiver.calls
    job = read_webhook(body, headers, SECRET)
    assert job == job_queue.get(job_id)
    assert job.state is JobState.SUCCEEDED
    assert job.result.held_s == 0.25
    assert headers["webhook-id"] == job_id


def test_a_cancelled_job_is_told_of_too(receiver, courier, job_queue):
    job_id = job_queue.submit(NoopRequest(webhook_url=receiver.url))[0].id
    assert courier.deliver() == 0
    job_queue.cancel(job_id)
    assert courier.deliver() == 1
    headers, body = receiver.calls[0]
    assert read_webhook(body, headers, SECRET).state is JobState.CANCELLED


def test_a_job_without_a_webhook_is_not_told_of(courier, job_queue, client):
    job_queue.cancel(job_queue.submit(NoopRequest())[0].id)
    assert client.zcard(KEYS.webhooks) == 0


@pytest.mark.parametrize("status", [500, 404, 302])
def test_what_is_not_heard_is_tried_again_later(receiver, courier, end, client, status):
    receiver.status = status
    job_id = end(receiver.url)
    before = time.time()
    assert courier.deliver() == 0
    due = client.zscore(KEYS.webhooks, job_id) - webhooks.DELAYS_S[0]
    assert before - 0.1 <= due <= time.time() + 0.1
    assert len(receiver.calls) == 1
    client.zadd(KEYS.webhooks, {job_id: time.time() + 600})
    assert courier.deliver() == 0
    assert len(receiver.calls) == 1, "not before its time, and no redirect is followed"
    receiver.status = 200
    make_due(client, job_id)
    assert courier.deliver() == 1
    assert receiver.calls[1][0]["DLO-Attempt"] == "2"


def test_it_is_given_up_in_the_end(receiver, courier, end, client):
    receiver.status = 503
    job_id = end(receiver.url)
    for _ in range(20):
        courier.deliver()
        if client.zscore(KEYS.webhooks, job_id) is None:
            break
        make_due(client, job_id)
    assert len(receiver.calls) == 1 + len(webhooks.DELAYS_S)
    assert client.ttl(KEYS.job(job_id)) > 0, "the record still expires"


def test_nobody_listens(courier, end):
    end(f"http://127.0.0.1:{free_port()}/hook")
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
    client.delete(KEYS.job(job_id))
    assert courier.deliver() == 0
    assert client.zcard(KEYS.webhooks) == 0
    assert receiver.calls == []


def again(secret: str, age_s: int, body: bytes) -> dict[str, str]:
    return webhooks.signed_headers(secret, "id", int(time.time()) - age_s, body)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body, headers: (body + b" ", headers), "not of this secret"),
        (lambda body, headers: (body, headers | {"webhook-id": "other"}), "not of this secret"),
        (
            lambda body, headers: (body, headers | {"webhook-signature": "v2,abc"}),
            "not of this secret",
        ),
        (lambda body, headers: (body, {}), "no webhook-id"),
        (lambda body, headers: (b"{}", again(SECRET, 0, b"{}")), "no job"),
        (lambda body, headers: (body, again(SECRET, 1000, body)), "too old"),
        (lambda body, headers: (body, again("another", 0, body)), "not of this secret"),
        (lambda body, headers: (body, headers | {"webhook-timestamp": "now"}), "timestamp"),
    ],
)
def test_a_forged_webhook_is_refused(receiver, courier, end, change, said):
    end(receiver.url)
    courier.deliver()
    headers, body = receiver.calls[0]
    body, headers = change(body, {name.lower(): value for name, value in headers.items()})
    with pytest.raises(UnexpectedReply, match=said):
        read_webhook(body, headers, SECRET)


def test_signatures_are_those_of_the_standard():
    """The example of the specification of Standard Webhooks."""
    headers = webhooks.signed_headers(
        "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
        "msg_p5jXN8AQM9LWM0D4loKWxJek",
        1614265330,
        b'{"test": 2432232314}',
    )
    assert headers["webhook-signature"] == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_of_several_signatures_one_has_to_fit(receiver, courier, end):
    end(receiver.url)
    courier.deliver()
    headers, body = receiver.calls[0]
    both = {**headers, "webhook-signature": f"v1,b2xk {headers['webhook-signature']}"}
    assert read_webhook(body, both, SECRET).state is JobState.SUCCEEDED


@pytest.fixture
def dripping():
    """The address of a receiver that answers one byte now and then, for ever."""
    stop = threading.Event()
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(0.05)

    def drip(connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection:
            while not stop.wait(0.02):
                connection.sendall(b"H")

    def listen() -> None:
        while not stop.is_set():
            with contextlib.suppress(TimeoutError):
                threading.Thread(target=drip, args=[listener.accept()[0]], daemon=True).start()

    thread = threading.Thread(target=listen)
    thread.start()
    yield f"http://127.0.0.1:{listener.getsockname()[1]}/"
    stop.set()
    thread.join()
    listener.close()


def test_a_receiver_that_drips_is_left_and_holds_up_nobody(
    receiver, courier, end, client, dripping, monkeypatch
):
    """Its every byte began a new time limit, and all webhooks of the worker waited for it."""
    monkeypatch.setattr(webhooks, "_DEADLINE_S", 3.0)
    slow = [end(dripping) for _ in range(6)]
    for _ in range(3):
        end(receiver.url)
    assert courier.deliver() == 3
    assert len(receiver.calls) == 3
    assert all(client.zscore(KEYS.webhooks, job_id) > time.time() - 1 for job_id in slow)


def give_up(courier, receiver, client, job_id) -> None:
    receiver.status = 503
    for _ in range(20):
        courier.deliver()
        if client.zscore(KEYS.webhooks, job_id) is None:
            return
        make_due(client, job_id)
    raise AssertionError("never given up")


def test_what_was_given_up_can_be_sent_again(receiver, courier, end, client, job_queue):
    """It was gone, with one line in a log."""
    job_id = end(receiver.url)
    give_up(courier, receiver, client, job_id)
    (letter,) = job_queue.dead_letters.all()
    assert (letter.job_id, letter.url, letter.error) == (job_id, receiver.url, "answered 503")
    client.delete(KEYS.job(job_id))  # as by expiry
    receiver.status = 200
    del receiver.calls[:]
    assert job_queue.dead_letters.resend(job_id)
    assert courier.deliver() == 1
    headers, body = receiver.calls[0]
    assert read_webhook(body, headers, SECRET).id == job_id
    assert job_queue.dead_letters.all() == []
    assert not job_queue.dead_letters.resend(job_id)


def test_what_is_given_up_again_stays_a_dead_letter(receiver, courier, end, client, job_queue):
    job_id = end(receiver.url)
    give_up(courier, receiver, client, job_id)
    job_queue.dead_letters.resend(job_id)
    give_up(courier, receiver, client, job_id)
    (letter,) = job_queue.dead_letters.all()
    assert letter.attempts == 0


@pytest.mark.slow
def test_a_worker_delivers(settings, start_worker, job_queue, receiver):
    with_secret = settings.model_copy(update={"webhook_secret": SECRET})
    start_worker(with_secret)
    job_queue.submit(NoopRequest(webhook_url=receiver.url))
    headers, body = wait_until(lambda: receiver.calls)[0]
    assert read_webhook(body, headers, SECRET).state is JobState.SUCCEEDED


def test_hosts_need_a_secret(monkeypatch):
    monkeypatch.setenv("DLO_WEBHOOK_HOSTS", "cell.example, plc:8080")
    with pytest.raises(ValueError, match="DLO_WEBHOOK_SECRET"):
        Settings()
    monkeypatch.setenv("DLO_WEBHOOK_SECRET", SECRET)
    assert Settings().webhook_hosts == ("cell.example", "plc:8080")
    assert SECRET not in repr(Settings())
