"""The backend's HTTP: the standard library's server, as it needs four small routes."""

from __future__ import annotations

import base64
import hmac
import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

from dlo_client.labelling.backend.answers import Answers

_LARGEST_BODY = 32 * 1024 * 1024
_STALLED_S = 30.0

log = logging.getLogger(__name__)


def make_server(answers: Answers, host: str, port: int, password: str = "") -> ThreadingHTTPServer:
    """Not yet serving. With a ``password`` calls need HTTP basic authentication, any user."""

    class Handler(BaseHTTPRequestHandler):
        timeout = _STALLED_S

        def do_GET(self) -> None:
            self._answer(b"")

        def do_POST(self) -> None:
            length = self.headers.get("Content-Length", "")
            if not length.isdecimal() or int(length) > _LARGEST_BODY:
                self._write(413, {"detail": "a body of known length, up to 32 MiB, is expected"})
                return
            self._answer(self.rfile.read(int(length)))

        def _answer(self, body: bytes) -> None:
            if not _opens(self.headers.get("Authorization", ""), password):
                self._write(401, {"detail": "basic authentication is needed"})
                return
            try:
                status, content = answers.answer(self.command, self.path.partition("?")[0], body)
            except Exception:
                log.exception("a call failed")
                status, content = 500, {"detail": "an error of the backend; see its log"}
            self._write(status, content)

        def _write(self, status: int, content: dict[str, Any]) -> None:
            data = json.dumps(content).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  the base class's name
            log.info(format, *args)

    return ThreadingHTTPServer((host, port), Handler)


@contextmanager
def serving(
    answers: Answers, host: str = "127.0.0.1", port: int = 0, password: str = ""
) -> Iterator[str]:
    """The backend's address, while the context is open."""
    server = make_server(answers, host, port, password)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://{host}:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join(5)


def _opens(header: str, password: str) -> bool:
    if not password:
        return True
    try:
        given = (
            base64.b64decode(header.removeprefix("Basic "), validate=True)
            .decode()
            .partition(":")[2]
        )
    except ValueError:
        return False
    return hmac.compare_digest(given.encode(), password.encode())
