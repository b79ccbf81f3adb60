"""The warm child as its parent sees it: a process that can be given a job, watched, killed and replaced."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from dataclasses import asdict
from multiprocessing.connection import Connection

from dlo_client.contracts import NetworkInfo

from workers.ledger import Claim
from workers.settings import Settings

_LOAD_LIMIT_S = 300.0


class ChildDied(Exception):
    """The child is gone; it has to be started anew."""


class ChildProcess:
    """At most one child at a time; all its processes are one group, so that killing it leaves nothing."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._jobs = 0
        self._rss_mb = 0.0
        self.networks: list[NetworkInfo] = []
        """What it has loaded; stays when it dies."""
        self.ready = False

    @property
    def alive(self) -> bool:
        process = self._process  # another thread may ask while it is being replaced
        return process is not None and process.poll() is None

    @property
    def worn(self) -> bool:
        """Whether it has done so many jobs, or grown so large, that it should be replaced."""
        return self._jobs >= self._settings.recycle_after_jobs or self._rss_mb > self._settings.recycle_rss_mb

    def start(self) -> None:
        """Start one and return once it is warm; raises ChildDied.

        Only from a thread that lives on: the child dies with it.
        """
        self.kill()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "workers.child", str(theirs.fileno()), str(os.getpid())],
                pass_fds=[theirs.fileno()],
                process_group=0,
                stdin=subprocess.DEVNULL,
            )
        self._connection = Connection(ours.detach())
        self._jobs, self._rss_mb = 0, 0.0
        self._send(self._settings.model_dump_json())
        if not self.wait(_LOAD_LIMIT_S):
            raise ChildDied(f"not warm within {_LOAD_LIMIT_S:g} s")
        self.networks = [NetworkInfo(**network) for network in json.loads(self._receive())]
        self.ready = True

    def give(self, claim: Claim) -> None:
        """Hand it a job; raises ChildDied."""
        self._send(json.dumps(asdict(claim)))

    def wait(self, seconds: float) -> bool:
        """Whether, within ``seconds``, it has something to say or has died."""
        return self._connection is None or self._connection.poll(seconds)

    def finish(self) -> None:
        """Take its word that the job is over; raises ChildDied."""
        self._rss_mb = json.loads(self._receive())["rss_mb"]
        self._jobs += 1

    def kill(self) -> None:
        """Kill the child with all that it has started; nothing happens if there is none."""
        self.ready = False
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._process = None
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _send(self, message: str) -> None:
        try:
            self._open().send_bytes(message.encode())
        except OSError as error:
            raise ChildDied(str(error)) from error

    def _receive(self) -> bytes:
        try:
            return self._open().recv_bytes()
        except (EOFError, OSError) as error:
            raise ChildDied(str(error)) from error

    def _open(self) -> Connection:
        if self._connection is None:
            raise ChildDied("not started")
        return self._connection
