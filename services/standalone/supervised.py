"""Child processes that are kept running until they are to stop."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Mapping, Sequence

import structlog

log = structlog.get_logger(__name__)

_PAUSE_S = 1.0
"""Before a child that has ended is started again."""


class Child:
    """``python -m module arguments`` in a group of its own: a Ctrl-C at the terminal reaches only us."""

    def __init__(self, module: str, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        self._command = (sys.executable, "-m", module, *arguments)
        self._name = module
        self._environment = environment
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
