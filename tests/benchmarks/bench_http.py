"""Overhead of the whole path: no-op jobs with ``?wait=10``, end to end over HTTP, against one warm worker.

``python -m tests.benchmarks.bench_http [--jobs N]`` starts a service of its own and prints p50 and p95.
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


def measure(address: str, jobs: int) -> np.ndarray:
    """Milliseconds (jobs,) from sending a request to having read the ended job, one after the other."""
    took_ms = np.empty(WARM_UP + jobs)
    with httpx.Client(base_url=address, timeout=30) as client:
        for index in range(len(took_ms)):
            started = time.perf_counter()
            response = client.post("/v1/jobs?wait=10", json={"kind": "noop"})
            took_ms[index] = (time.perf_counter() - started) * 1000
            assert response.status_code == 200, response.text
    return took_ms[WARM_UP:]


def summary(took_ms: np.ndarray) -> dict[str, float]:
    p50, p95 = np.percentile(took_ms, (50, 95))
    return {"jobs": len(took_ms), "p50_ms": round(float(p50), 2), "p95_ms": round(float(p95), 2)}


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
        service = [sys.executable, "-m", "services", "--port", "0", "--data-dir", data_dir, "--then", *here]
        return subprocess.run(service, env=os.environ | {"DLO_LOG_LEVEL": "WARNING"}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
