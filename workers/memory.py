"""How much memory a child may take: a job that needs more fails, and nothing else suffers."""

from __future__ import annotations

import contextlib
import os
import resource
import traceback
from collections.abc import Iterator
from pathlib import Path

from workers.settings import Settings

_SHARE = 0.75
_TO_REPORT_MB = 64
_CGROUP = Path("/sys/fs/cgroup/memory.max")
_OWN_SCORE = Path("/proc/self/oom_score_adj")
_FIRST_TO_GO = "500"
_SIGNS = ("Insufficient memory", "bad_alloc", "Failed to allocate memory", "Unable to allocate")
"""Of OpenCV, the C++ library, ONNX Runtime and NumPy."""


def limit_mb(settings: Settings) -> int:
    """What one child may take."""
    return settings.child_memory_mb or int(_machine_mb() * _SHARE / settings.workers)


def limit(settings: Settings) -> None:
    """Hold this process to its limit from now on; the kernel ends it first if the machine runs out
    all the same."""
    size = limit_mb(settings) * 2**20
    resource.setrlimit(resource.RLIMIT_DATA, (size, size + _TO_REPORT_MB * 2**20))
    if _OWN_SCORE.exists():
        _OWN_SCORE.write_text(_FIRST_TO_GO)


@contextlib.contextmanager
def room_to_report(error: BaseException) -> Iterator[None]:
    """What the frames of ``error`` hold is let go, and a little more than the limit may be taken:
    that memory ran out has to be written down."""
    traceback.clear_frames(error.__traceback__)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def ran_out(error: Exception) -> bool:
    """Whether ``error`` means that memory was refused."""
    return isinstance(error, MemoryError) or any(sign in str(error) for sign in _SIGNS)


def taken_mb(pid: int) -> float:
    """Private memory that a process has asked for; 0 where the system does not say."""
    return _status_mb(pid, "VmData:")


def resident_mb(pid: int) -> float:
    """Memory of a process that is in use; 0 where the system does not say."""
    return _status_mb(pid, "VmRSS:")


def _status_mb(pid: int, name: str) -> float:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(name)), 0.0)


def _machine_mb() -> float:
    """Of the machine, or of the container if that is given less."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    given = _CGROUP.read_text().strip() if _CGROUP.exists() else ""
    return min(machine, int(given) if given.isdecimal() else machine) / 2**20
