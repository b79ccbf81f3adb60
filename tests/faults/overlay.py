"""Changes of a machine as its processes see it: what runs in each of them before anything else."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from tests.processes import ROOT

_LIBRARY = "libfaketime.so.1"
_SEEN_WITHIN_S = 2.0


class SkippedError(Exception):
    """The machine does not allow a scenario; the message names what is missing."""


@contextmanager
def overlay(program: str) -> Iterator[dict[str, str]]:
    """The environment of processes that run ``program`` when they start."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "sitecustomize.py").write_text(program)
        yield {"PYTHONPATH": f"{folder}:{ROOT}:{ROOT / 'clients/python'}"}


@contextmanager
def clock() -> Iterator[Callable[[int], None]]:
    """Sets the clock of all processes that are started meanwhile so many seconds on; needs
    libfaketime (Debian)."""
    library = next(Path("/usr/lib").glob(f"**/{_LIBRARY}"), None)
    if library is None:
        raise SkippedError(f"{_LIBRARY} is missing: apt-get install libfaketime")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "offset"

        def step(seconds: int) -> None:
            beside = file.with_name("next")
            beside.write_text(f"{seconds:+d}")
            beside.replace(file)
            time.sleep(_SEEN_WITHIN_S)

        step(0)
        changed = {
            "LD_PRELOAD": str(library),
            "FAKETIME_TIMESTAMP_FILE": str(file),
            "FAKETIME_CACHE_DURATION": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        }
        with mock.patch.dict(os.environ, changed):
            yield step
