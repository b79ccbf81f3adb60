"""The whole path over HTTP, one job after the other with ``?wait=10``, against one warm worker:
no-op jobs, and `instances` without files of the bundled photograph of 640 × 360 px.

``python -m tests.benchmarks.bench_http [--jobs N]`` starts a service of its own and prints p50 and
p95 of both, which run in turn.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np

WARM_UP = 20
PICTURE = Path(__file__).parents[1] / "samples" / "busy.jpg"


def bodies() -> dict[str, tuple[bytes, str]]:
    """What is sent for each kind, and its content type."""
    picture = {"image": (PICTURE.name, PICTURE.read_bytes())}
    request = {"request": (None, json.dumps({"kind": "instances", "files": []}))}
    form = httpx.Request("POST", "http://x", files={**request, **picture})
    return {
        "noop": (json.dumps({"kind": "noop"}).encode(), "application/json"),
        "instances": (form.read(), form.headers["content-type"]),
    }


def measure(address: str, jobs: int) -> dict[str, np.ndarray]:
    """Milliseconds (jobs,) from sending a request to having read the ended job, by kind. Who asks
    is on this machine too, and does as little as can be done."""
    took_ms = {"noop": np.empty(WARM_UP + jobs), "instances": np.empty(WARM_UP + jobs)}
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=30)
    sent = bodies()
    for index in range(WARM_UP + jobs):
        for kind, taken in took_ms.items():
            body, content_type = sent[kind]
            started = time.perf_counter()
            connection.request(
                "POST", "/v1/jobs?wait=10", body, headers={"Content-Type": content_type}
            )
            answer = json.loads(connection.getresponse().read())
            taken[index] = (time.perf_counter() - started) * 1000
            assert answer["state"] == "succeeded", answer
    connection.close()
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
