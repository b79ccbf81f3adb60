"""Child processes that are kept running until they are to stop."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import sys
from collections.abc import Mapping, Sequence
from uuid import uuid4

import structlog

from workers import watchdog

log = structlog.get_logger(__name__)

_PAUSE_S = 1.0
"""Before a child that has ended is started again."""

_SILENT_S = 15.0
"""A child that has given signs of life (:mod:`workers.watchdog`) and stops is frozen."""


class Child:
    """``python -m module arguments`` in a group of its own: a Ctrl-C at the terminal reaches only
    us."""

    def __init__(
        self, module: str, arguments: Sequence[str], environment: Mapping[str, str]
    ) -> None:
        self._command = (sys.executable, "-m", module, *arguments)
        self._name = module
        self._address = f"@dlo-{uuid4().hex}"
        self._environment = {**environment, watchdog.VARIABLE: self._address}
        self._beats = False
        self._process: asyncio.subprocess.Process | None = None
        self._stopping = asyncio.Event()
        self._keeping: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start it, and start it again whenever it ends."""
        self._keeping = asyncio.create_task(self._keep(), name=self._name)

    async def stop(self, grace_s: float) -> None:
        """Ask it to end, and after ``grace_s`` seconds kill it with all its children."""
        self._stopping.set()
        if self._keeping is None:
            return
        self._signal(signal.SIGTERM)
        await asyncio.wait({self._keeping}, timeout=grace_s)
        self._signal(signal.SIGKILL)
        await self._keeping

    async def _keep(self) -> None:
        watching = asyncio.create_task(self._watch())
        try:
            await self._keep_running()
        finally:
            watching.cancel()

    async def _watch(self) -> None:
        """Kill the child once it has fallen silent."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
            listener.bind(f"\0{self._address[1:]}")
            listener.setblocking(False)
            while True:
                try:
                    await asyncio.wait_for(
                        asyncio.get_running_loop().sock_recv(listener, 64), _SILENT_S
                    )
                    self._beats = True
                except TimeoutError:
                    if self._beats:
                        log.error("child is frozen; killing it", child=self._name)
                        self._beats = False
                        self._signal(signal.SIGKILL)

    async def _keep_running(self) -> None:
        while not self._stopping.is_set():
            self._process = await asyncio.create_subprocess_exec(
                *self._command, env=self._environment, start_new_session=True
            )
            if self._stopping.is_set():
                self._signal(signal.SIGTERM)
            code = await self._process.wait()
            if not self._stopping.is_set():
                log.error("child ended; starting it again", child=self._name, code=code)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._stopping.wait(), _PAUSE_S)

    def _signal(self, sent: signal.Signals) -> None:
        """To the whole group, which may outlive the process that leads it."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, sent)
