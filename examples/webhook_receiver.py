"""Receive the ended job instead of waiting for it. The service must allow the host and share the
secret:

DLO_WEBHOOK_HOSTS=127.0.0.1 DLO_WEBHOOK_SECRET=at-least-16-characters make serve
DLO_WEBHOOK_SECRET=at-least-16-characters python examples/webhook_receiver.py
"""

from __future__ import annotations

import argparse
import os
import queue
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

from dlo_client import AnyJob, Client, InstancesRequest, UnexpectedReply, read_webhook

SAMPLE = Path(__file__).parent.parent / "tests" / "samples" / "plain.jpg"


def main(arguments: list[str] | None = None) -> AnyJob:
    """The job that was delivered."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--port", type=int, default=0, help="to listen on; 0 takes a free one")
    options = parser.parse_args(arguments)
    secret = os.environ.get("DLO_WEBHOOK_SECRET")
    if not secret:
        sys.exit("set DLO_WEBHOOK_SECRET to the secret that the service signs with")
    delivered: queue.Queue[AnyJob] = queue.Queue()
    server = HTTPServer(("127.0.0.1", options.port), receiver(delivered, secret))
    Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_address[1]}/jobs"
    try:
        with Client(options.url) as client:
            submitted = client.submit(
                InstancesRequest(webhook_url=address, files=[], timeout_s=120), SAMPLE
            )
            try:
                job = delivered.get(timeout=150)
            except queue.Empty:
                sys.exit(f"nothing came: job {submitted.id} is {client.get(submitted).state}")
    finally:
        server.shutdown()
        server.server_close()
    assert job.id == submitted.id
    print(f"job {job.id} {job.state}: {job.result!r}")
    return job


def receiver(delivered: queue.Queue[AnyJob], secret: str) -> type[BaseHTTPRequestHandler]:
    """Answers 204 to what is genuine and fresh, 400 to anything else. Remember ids: one may come
    twice."""
    seen: set[str] = set()

    class Receiver(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            try:
                job = read_webhook(body, dict(self.headers), secret)
            except UnexpectedReply:
                self.send_response(400)
            else:
                self.send_response(204)
                if job.id not in seen:
                    seen.add(job.id)
                    delivered.put(job)
            self.end_headers()

    return Receiver


if __name__ == "__main__":
    main()
