"""A warm child as its parent sees it: a process that can be given a job, watched and killed."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
import termios
import time
from dataclasses import asdict
from multiprocessing.connection import Connection

from dlo_client.contracts import NetworkInfo

from workers import memory
from workers.ledger import Claim
from workers.settings import Settings

PROGRAM = "workers.child"
"""The module that runs as the child."""

_LOAD_LIMIT_S = 300.0
_BEGIN_WITHIN_S = 10.0
"""A child that has not taken up its job by then is frozen."""

_GONE_WITHIN_S = 2.0
_NEAR_ITS_LIMIT = 0.6
_WORN_AT = 0.5
_SPENT_AT = 0.8
"""Of the memory that it may take beyond what it had when it was warm: what its jobs have left
behind."""


class ChildDied(Exception):
    """The child is gone; it has to be started anew."""


class ChildProcess:
    """At most one child at a time; all its processes are one group, so that killing it leaves
    nothing."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._jobs = 0
        self._rss_mb = 0.0
        self._largest_mb = 0.0
        self._warm_mb = self._left_mb = 0.0
        self._started = 0.0
        self._given: float | None = None
        self.networks: list[NetworkInfo] = []
        """What it has loaded; stays when it dies."""
        self.ready = False

    @property
    def alive(self) -> bool:
        process = self._process  # another thread may ask while it is being replaced
        return process is not None and process.poll() is None

    @property
    def memory_mb(self) -> float:
        """Resident now; 0 if there is none."""
        process = self._process
        return memory.resident_mb(process.pid) if process is not None else 0.0

    @property
    def worn(self) -> bool:
        """Whether it has done so many jobs, or grown so large, that it should be replaced."""
        settings = self._settings
        large = self._rss_mb > settings.recycle_rss_mb or self._has_left(_WORN_AT)
        return self._jobs >= settings.recycle_after_jobs or large

    @property
    def spent(self) -> bool:
        """Whether it has grown so large that the next job, however small, may find no memory."""
        return self._has_left(_SPENT_AT)

    @property
    def frozen(self) -> bool:
        """Whether it was given a job and does not take it up."""
        given_long_ago = (
            self._given is not None and time.monotonic() - self._given > _BEGIN_WITHIN_S
        )
        return given_long_ago and self._connection is not None and _unread(self._connection) > 0

    @property
    def died_of_memory(self) -> bool:
        """Whether it gave up, as native code does that is refused memory, when it had taken most of
        its share."""
        limit_mb = memory.limit_mb(self._settings)
        if self._process is None:
            return False
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_GONE_WITHIN_S)  # its socket is closed a moment before it is gone
        return (
            self._process.returncode == -signal.SIGABRT
            and self._largest_mb > _NEAR_ITS_LIMIT * limit_mb
        )

    def begin(self) -> None:
        """Start one; it warms up by itself.

        Only from a thread that lives on: the child dies with it.
        """
        self.kill()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", PROGRAM, str(theirs.fileno()), str(os.getpid())],
                pass_fds=[theirs.fileno()],
                process_group=0,
                stdin=subprocess.DEVNULL,
            )
        self._connection = Connection(ours.detach())
        self._jobs, self._rss_mb, self._largest_mb, self._given = 0, 0.0, 0.0, None
        self._warm_mb = self._left_mb = 0.0
        self._started = time.monotonic()
        self._send(self._settings.model_dump_json())

    def warm(self, wait_s: float = 0.0) -> bool:
        """Whether, within ``wait_s``, it is warm; raises ChildDied."""
        if not self.ready:
            if not self._open().poll(wait_s):
                if time.monotonic() - self._started > _LOAD_LIMIT_S:
                    raise ChildDied(f"not warm within {_LOAD_LIMIT_S:g} s")
                return False
            self.networks = [NetworkInfo(**network) for network in json.loads(self._receive())]
            self._warm_mb = self._taken_mb()
            self.ready = True
        return True

    def start(self) -> None:
        """Start one and return once it is warm; raises ChildDied. As :meth:`begin`, from a thread
        that lives on."""
        self.begin()
        while not self.warm(1.0):
            pass

    def give(self, claim: Claim) -> None:
        """Hand it a job; raises ChildDied."""
        self._given = time.monotonic()
        self._send(json.dumps(asdict(claim)))

    def wait(self, seconds: float) -> bool:
        """Whether, within ``seconds``, it is done with its job or has died."""
        if self._connection is None or self._connection.poll(seconds):
            return True
        self._largest_mb = max(self._largest_mb, self._taken_mb())
        return False

    @property
    def has_begun(self) -> bool:
        """Whether it has taken up the job that it was given."""
        return self._connection is not None and _unread(self._connection) == 0

    def pause(self) -> None:
        """Let it stand still, with all that it has started, until :meth:`resume`."""
        self._signal(signal.SIGSTOP)

    def resume(self) -> None:
        self._signal(signal.SIGCONT)

    def finish(self) -> None:
        """Take its word that the job is over; raises ChildDied."""
        self._rss_mb = json.loads(self._receive())["rss_mb"]
        self._left_mb = self._taken_mb()
        self._jobs, self._given = self._jobs + 1, None

    def kill(self) -> None:
        """Kill the child with all that it has started; nothing happens if there is none."""
        self.ready = False
        if self._process is not None:
            self._signal(signal.SIGKILL)
            self._process.wait()
            self._process = None
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)

    def _has_left(self, share: float) -> bool:
        room_mb = max(memory.limit_mb(self._settings) - self._warm_mb, 0.0)
        return self._left_mb > self._warm_mb + share * room_mb

    def _taken_mb(self) -> float:
        return memory.taken_mb(self._process.pid) if self._process is not None else 0.0

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


def _unread(connection: Connection) -> int:
    """Bytes that were sent and are not taken up; 0 where the system does not say."""
    if sys.platform != "linux":
        return 0
    answer = fcntl.ioctl(connection.fileno(), termios.TIOCOUTQ, bytes(4))
    return int.from_bytes(answer, sys.byteorder)
