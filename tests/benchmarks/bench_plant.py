"""What a plant asks of the service besides throughput: ``python -m tests.benchmarks.bench_plant
[--only stalls,loop]``.

Longest stall of the one worker when its child is replaced, longest time for which the event loop
stands still under large requests, overhead of a job, and what a robot waits while a batch runs.
Writes ``build/bench/plant.json``.
"""

from __future__ import annotations

import argparse
import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from tests.faults.plant import Plant, plant

_PICTURE = Path(__file__).parent.parent / "samples" / "plain.jpg"
Row = dict[str, Any]


def _job(client: httpx.Client, **fields: Any) -> tuple[float, Row]:
    """Milliseconds of the whole path, and the ended job."""
    started = time.perf_counter()
    answer = client.post("/v1/jobs?wait=60", json={"kind": "noop"} | fields)
    took_ms = (time.perf_counter() - started) * 1000
    assert answer.status_code == 200, answer.text
    return took_ms, answer.json()


def _client(there: Plant) -> httpx.Client:
    return httpx.Client(base_url=there.url, timeout=90)


def _summary(values: list[float]) -> Row:
    p50, p95 = np.percentile(values, (50, 95))
    return {
        "n": len(values),
        "p50": round(float(p50), 1),
        "p95": round(float(p95), 1),
        "worst": round(max(values), 1),
    }


def stalls() -> Row:
    """Milliseconds of a no-op: as such, while children are recycled every 25 jobs, and right after
    a cancel."""
    with plant(recycle_after_jobs=25, spare_child=True) as there, _client(there) as client:
        for _ in range(5):
            _job(client)
        recycled = [_job(client)[0] for _ in range(150)]
    cancelled = []
    with plant(spare_child=True) as there, _client(there) as client:
        plain = [_job(client)[0] for _ in range(150)]
        for _ in range(5):
            time.sleep(8)  # the next child warms up
            job = client.post("/v1/jobs", json={"kind": "noop", "hold_s": 30}).json()
            while client.get(f"/v1/jobs/{job['id']}").json()["state"] != "running":
                time.sleep(0.01)
            client.delete(f"/v1/jobs/{job['id']}")
            cancelled.append(_job(client)[0])
    return {
        "plain": _summary(plain),
        "recycling": _summary(recycled),
        "after a cancel": _summary(cancelled),
    }


def loop() -> Row:
    """Milliseconds of ``/healthz`` while requests of 4 MiB are refused, or taken."""
    wrong = json.dumps({"kind": "merge_curves", "curves": [{"a": k} for k in range(250_000)]})
    point = [0.123456789] * 3
    curve = {
        "points_m": [point] * 5000,
        "covariance_m2": [[1e-6] * 6] * 5000,
        "sigma_m": [1e-3] * 5000,
        "length_m": 1.0,
    }
    large = json.dumps({"kind": "merge_curves", "curves": [curve] * 6})
    rows = {}
    with plant() as there, _client(there) as client:
        rows["nothing else"] = _pings(there, lambda: time.sleep(3))
        for name, body in {
            "49 000 errors": wrong[: 4 * 2**20],
            "large": large[: 4 * 2**20],
        }.items():
            text = body.encode()
            headers = {"Content-Type": "application/json"}

            def send(text: bytes = text, headers: dict[str, str] = headers) -> None:
                for _ in range(3):
                    client.post("/v1/jobs", content=text, headers=headers)

            rows[f"{name}, {len(text) / 2**20:.1f} MiB"] = _pings(there, send)
    return rows


def _pings(there: Plant, meanwhile: Callable[[], object]) -> Row:
    found: list[float] = []
    done = threading.Event()

    def ping() -> None:
        with httpx.Client(base_url=there.url, timeout=60) as client:
            while not done.is_set():
                started = time.perf_counter()
                client.get("/healthz")
                found.append((time.perf_counter() - started) * 1000)
                time.sleep(0.002)

    thread = threading.Thread(target=ping)
    thread.start()
    meanwhile()
    done.set()
    thread.join()
    return _summary(found)


def overhead() -> Row:
    """Milliseconds of the whole path beyond those that the stage itself took."""
    rows = {}
    with plant() as there, _client(there) as client:
        image = client.post("/v1/images", content=_PICTURE.read_bytes()).json()["id"]
        asked = {
            "noop": {},
            "instances": {"kind": "instances", "image": {"id": image}, "files": []},
        }
        for name, fields in asked.items():
            values = []
            for index in range(110):
                took_ms, job = _job(client, **fields)
                timings = job["timings_ms"]
                if index >= 10:
                    values.append(took_ms - (timings["total"] - timings["queue_wait"]))
            rows[name] = _summary(values)
    return rows


def robot() -> Row:
    """Milliseconds of an interactive no-op while batch jobs wait, one worker: hundreds of 0.1 s,
    some of 20 s."""
    rows = _beside_short_jobs()
    with plant(spare_child=True) as there, _client(there) as client:
        there.settled_mb()
        for _ in range(4):
            client.post(
                "/v1/jobs",
                json={"kind": "noop", "hold_s": 20, "priority": "batch", "timeout_s": 3000.0},
            )
        beside = []
        for _ in range(4):
            there.settled_mb()  # the next child is warm
            beside.append(_job(client)[0])
    return rows | {"beside a batch of jobs of 20 s": _summary(beside)}


def _beside_short_jobs() -> Row:
    with plant(max_queue_depth=5000) as there, _client(there) as client:
        alone = [_job(client)[0] for _ in range(30)]
        batch = {"kind": "noop", "hold_s": 0.1, "priority": "batch", "timeout_s": 3000.0}
        for _ in range(300):
            client.post("/v1/jobs", json=batch)
        beside = []
        for _ in range(30):
            beside.append(_job(client)[0])
            time.sleep(0.05)
        assert there.queue.depth()["batch"] > 0
    return {"alone": _summary(alone), "beside a batch": _summary(beside)}


MEASURES: dict[str, Callable[[], Row]] = {
    measure.__name__: measure for measure in (stalls, loop, overhead, robot)
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--out", type=Path, default=Path("build/bench/plant.json"))
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    found = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    for name in asked.only.split(",") if asked.only else list(MEASURES):
        found[name] = MEASURES[name]()
        print(name, json.dumps(found[name]), flush=True)
        asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
