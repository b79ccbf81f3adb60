"""Faults of whoever is at the other end of a connection: clients and receivers that stop, or
drip."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import httpx

from tests.faults.plant import plant
from tests.faults.traffic import Tally, Traffic, probe
from tests.processes import wait_until

_SECRET = "of the fault suite's receivers"


def client_gone(jobs: int, faults: int) -> Tally:
    """Clients that hang up while they wait: their jobs end, and no connection stays open."""
    with plant() as there:
        host, port = there.url.removeprefix("http://").split(":")
        body = b'{"kind":"noop","hold_s":0.2,"timeout_s":600}'
        head = (
            f"POST /v1/jobs?wait=30 HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
        )
        for _ in range(jobs):
            with socket.create_connection((host, int(port))) as connection:
                before = there.queue.counts().get(("noop", "queued"), 0)
                connection.sendall(head.encode() + b"Content-Length: %d\r\n\r\n" % len(body) + body)
                wait_until(
                    lambda before=before: there.queue.counts().get(("noop", "queued"), 0) > before,
                    60,
                )
        recovery_s = probe(there)

        def ended() -> bool:
            counts = there.queue.counts()
            over = sum(counts.get(("noop", state), 0) for state in ("succeeded", "failed"))
            return over >= counts["noop", "queued"] >= jobs

        wait_until(ended, 300)
        failed = there.queue.counts().get(("noop", "failed"), 0)
        return Tally(jobs=jobs, faults=jobs, failed=failed, worst_recovery_s=round(recovery_s, 2))


def dripping_clients(jobs: int, faults: int) -> Tally:
    """Fifty clients that send a byte a second: everybody else is served as before."""
    with plant() as there:
        host, port = there.url.removeprefix("http://").split(":")
        stop = threading.Event()
        head = f"POST /v1/jobs HTTP/1.1\r\nHost: {host}\r\nContent-Length: 100000\r\n\r\n".encode()

        def drip() -> None:
            with (
                contextlib.suppress(OSError),
                socket.create_connection((host, int(port))) as connection,
            ):
                connection.sendall(head)
                while not stop.wait(1.0):
                    connection.sendall(b" ")

        threads = [threading.Thread(target=drip, daemon=True) for _ in range(50)]
        for thread in threads:
            thread.start()
        recovery_s = probe(there)
        found = Traffic(there, jobs, pace_s=0.02).start().tally()
        stop.set()
        found.faults, found.worst_recovery_s = 50, round(recovery_s, 2)
        return found


def dripping_receivers(jobs: int, faults: int) -> Tally:
    """Three receivers of webhooks that answer a byte a second; a fourth is told of all its jobs
    meanwhile."""
    with (
        _dripping() as first,
        _dripping() as second,
        _dripping() as third,
        _listening() as (address, heard),
    ):
        hosts = ",".join([first, second, third, address])
        secret = {"webhook_secret": _SECRET}
        with (
            plant(
                env={"DLO_WEBHOOK_HOSTS": hosts, "DLO_WEBHOOK_SECRET": _SECRET}, **secret
            ) as there,
            httpx.Client(base_url=there.url, timeout=20) as client,
        ):
            wanted = {}
            for _ in range(jobs):
                for slow in (first, second, third):
                    _submit(client, slow)
                wanted[_submit(client, address)] = time.monotonic()
            with contextlib.suppress(AssertionError):
                wait_until(lambda: wanted.keys() <= heard.keys(), 120)
            waited = [heard[job_id] - sent for job_id, sent in wanted.items() if job_id in heard]
            return Tally(
                jobs=jobs,
                faults=3,
                lost=jobs - len(waited),
                worst_recovery_s=round(max(waited, default=0.0), 2),
                note="seconds: from a job's submission until its receiver was told",
            )


def _submit(client: httpx.Client, receiver: str) -> str:
    answer = client.post(
        "/v1/jobs", json={"kind": "noop", "webhook_url": f"http://{receiver}/ended"}
    )
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


@contextmanager
def _listening() -> Iterator[tuple[str, dict[str, float]]]:
    """Address of a receiver, and when it was told of each job."""
    heard: dict[str, float] = {}

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            job = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            heard.setdefault(job["id"], time.monotonic())
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    with _in_a_thread(server.serve_forever):
        yield f"127.0.0.1:{server.server_port}", heard
        server.shutdown()
    server.server_close()


@contextmanager
def _dripping() -> Iterator[str]:
    """Address of a receiver that takes everything and answers a byte a second."""
    stop = threading.Event()

    def answer(connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection:
            while not stop.wait(1.0):
                connection.sendall(b"H")

    def accept(listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while not stop.is_set():
                threading.Thread(target=answer, args=(listener.accept()[0],), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(300)
        with _in_a_thread(lambda: accept(listener)):
            yield f"127.0.0.1:{listener.getsockname()[1]}"
            stop.set()
            listener.shutdown(socket.SHUT_RDWR)


@contextmanager
def _in_a_thread(run: Callable[[], object]) -> Iterator[None]:
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    yield
    thread.join()
