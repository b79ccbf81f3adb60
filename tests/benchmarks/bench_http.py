"""The whole path over HTTP, one job after the other with ``?wait=10``, against one warm worker:
no-op jobs, and `instances` without files of the bundled photograph of 640 × 360 px.

``python -m tests.benchmarks.bench_http [--jobs N]`` starts a service of its own and prints p50 and
p95 of both, which run in turn.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx
import numpy as np

WARM_UP = 20
PICTURE = Path(__file__).parents[1] / "samples" / "busy.jpg"


def measure(address: str, jobs: int) -> dict[str, np.ndarray]:
    """Milliseconds (jobs,) from sending a request to having read the ended job, by kind."""
    took_ms = {"noop": np.empty(WARM_UP + jobs), "instances": np.empty(WARM_UP + jobs)}
    picture = PICTURE.read_bytes()
    with httpx.Client(base_url=address, timeout=30) as client:
        for index in range(WARM_UP + jobs):
            for kind, taken in took_ms.items():
                request = {"kind": kind} if kind == "noop" else {"kind": kind, "files": []}
                started = time.perf_counter()
                if kind == "noop":
                    response = client.post("/v1/jobs?wait=10", json=request)
                else:
                    parts = {
                        "request": (None, json.dumps(request)),
                        "image": (PICTURE.name, picture),
                    }
                    response = client.post("/v1/jobs?wait=10", files=parts)
                taken[index] = (time.perf_counter() - started) * 1000
                assert response.status_code == 200, response.text
    return {kind: taken[WARM_UP:] for kind, taken in took_ms.items()}


def summary(took_ms: dict[str, np.ndarray]) -> dict[str, dict[str, float]]:
    found = {}
    for kind, taken in took_ms.items():
        p50, p95 = np.percentile(taken, (50, 95))
        found[kind] = {
            "jobs": len(taken),
            "p50_ms": round(float(p50), 2),
            "p95_ms": round(float(p95), 2),
        }
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    arguments = parser.parse_args()
    if address := os.environ.get("DLO_URL"):
        result = summary(measure(address, arguments.jobs))
        print(result)
        arguments.out.mkdir(parents=True, exist_ok=True)
        (arguments.out / "http.json").write_text(json.dumps(result))
        return 0
    with tempfile.TemporaryDirectory() as data_dir:
        here = [sys.executable, "-m", "tests.benchmarks.bench_http", "--jobs", str(arguments.jobs)]
        here += ["--out", str(arguments.out.resolve())]
        service = [
            sys.executable,
            "-m",
            "services",
            "--port",
            "0",
            "--data-dir",
            data_dir,
            "--then",
            *here,
        ]
        return subprocess.run(
            service, env=os.environ | {"DLO_LOG_LEVEL": "WARNING"}, check=False
        ).returncode


if __name__ == "__main__":
    sys.exit(main())
