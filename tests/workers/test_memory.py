"""A job that needs more memory than it may take fails, and its worker can say so."""

from __future__ import annotations

import subprocess
import sys

from tests.processes import ROOT

PROGRAM = """
import resource
from pathlib import Path

from workers import memory
from workers.settings import Settings

taken = int(memory.taken_mb(__import__("os").getpid()))
memory.limit(Settings(data_dir=Path("."), child_memory_mb=taken + 60))


def job():
    held = []
    while True:
        held.append(bytearray(2**20))


def report():
    return len(bytearray(40 * 2**20))


before = resource.getrlimit(resource.RLIMIT_DATA)
try:
    job()
except MemoryError as error:
    with memory.room_to_report(error):
        print("reported", report())
print("held to it again", resource.getrlimit(resource.RLIMIT_DATA) == before)
"""


def test_that_memory_ran_out_can_be_reported() -> None:
    """Nothing was left to open a connection to the queue server: the child died, and the job failed
    as `worker_lost` after three tries."""
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines() == ["reported 41943040", "held to it again True"]
