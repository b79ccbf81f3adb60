"""Child processes under supervision."""

import asyncio
import os
import signal
import sys
import textwrap

from services.standalone import supervised
from services.standalone.supervised import Child

PROGRAM = """
    import os, pathlib, sys, time
    from workers import watchdog
    watchdog.beat()  # of one that never did nobody would say that it fell silent
    pathlib.Path(sys.argv[1]).open("a").write(f"{os.getpid()}\\n")
    while True:
        watchdog.beat()
        time.sleep(0.02)
"""


def test_a_frozen_child_is_replaced(tmp_path, monkeypatch):
    """Only its end was noticed: one that no longer turned was kept for ever."""
    monkeypatch.setattr(supervised, "_SILENT_S", 1.5)
    monkeypatch.setattr(supervised, "_PAUSE_S", 0.01)
    (tmp_path / "beating.py").write_text(textwrap.dedent(PROGRAM))
    pids = tmp_path / "pids"

    async def scenario() -> None:
        path = os.pathsep.join([str(tmp_path), *sys.path])
        child = Child("beating", [str(pids)], os.environ | {"PYTHONPATH": path})
        child.start()
        first = await started(1)
        os.kill(first, signal.SIGSTOP)
        await started(2)
        await child.stop(5.0)

    async def started(number: int) -> int:
        for _ in range(1500):
            if pids.exists() and len(lines := pids.read_text().split()) >= number:
                return int(lines[number - 1])
            await asyncio.sleep(0.02)
        raise AssertionError(f"start number {number} did not come")

    asyncio.run(scenario())
