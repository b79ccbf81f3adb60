"""How many jobs a second two hosts with a worker each do, against one; pictures in the bucket, all
else shared."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from statistics import median
from typing import Any

from tests.processes import ROOT
from tests.rehearsal.elsewhere import WAIT_S

_PICTURE = ROOT / "tests" / "samples" / "plain.jpg"
_SENDERS = 6
"""Three requests for each of two workers, so that none of them waits for a job."""
Row = dict[str, Any]


def computed(there: Any, jobs: int) -> Row:
    """Real work. Each host has one core, which it shares with everything else where there are only
    two."""
    return _compared(there, jobs, {"DLO_ONNX_THREADS": "1"}, "workers")


def timed(there: Any, jobs: int, wait_s: float) -> Row:
    """The work is a wait, as if the processor of another machine did it: what is measured is the
    service."""
    changes = {"DLO_ONNX_THREADS": "1", WAIT_S: str(wait_s)}
    return _compared(there, jobs, changes, "tests.rehearsal.elsewhere") | {
        "wait_ms": round(wait_s * 1000)
    }


def _compared(there: Any, jobs: int, changes: dict[str, str], module: str) -> Row:
    image = there.client.post("/v1/images", content=_PICTURE.read_bytes()).json()["id"]
    body = {"kind": "instances", "image": {"id": image}, "files": []}
    there.at_work(0)
    per_s: dict[int, list[float]] = {1: [], 2: []}
    for hosts in (1, 2, 1, 2):
        there.at_work(hosts, module, **changes)
        _per_s(there, body, 2 * _SENDERS)
        per_s[hosts].append(_per_s(there, body, jobs))
    there.at_work(0)
    one, two = (median(per_s[hosts]) for hosts in (1, 2))
    ratio = two / one
    return {
        "jobs": jobs,
        "one": round(one, 2),
        "two": round(two, 2),
        "ratio": round(ratio, 2),
        "bad": 0,
    }


def _per_s(there: Any, body: Row, jobs: int) -> float:
    """From the first that is sent to the last that has ended."""

    def ask(_: int) -> str:
        return str(there.client.post("/v1/jobs?wait=60", json=body).json()["state"])

    started = time.perf_counter()
    with ThreadPoolExecutor(_SENDERS) as senders:
        states = set(senders.map(ask, range(jobs)))
    assert states == {"succeeded"}, states
    return jobs / (time.perf_counter() - started)
