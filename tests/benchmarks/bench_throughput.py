"""The service against the bare pipeline, and the memory that requests can take.

``python -m tests.benchmarks.bench_throughput [--only throughput,memory] [--jobs 240] [--processes
2]``. Throughput: rounds of ``instances`` jobs without files, in turn through the service and
through as many processes that call the stage themselves. Memory: the most that service and workers
have while large requests come, a child being held to 1 GB. Writes ``build/bench/throughput.json``.
"""

from __future__ import annotations

import argparse
import http.client
import json
import multiprocessing
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from io import BytesIO
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np
from PIL import Image

from tests.faults.plant import Plant, plant

SAMPLES = Path(__file__).parent.parent / "samples"
PICTURES = [SAMPLES / f"{name}.jpg" for name in ("plain", "busy", "industrial")]
_ROUNDS = 6
_LIMIT_MB = 1000
Row = dict[str, Any]


def _compute(connection: Connection, folder: str) -> None:
    """A process that does as many jobs as it is sent, and answers the seconds of processor time."""
    from dlo_client.contracts import ImageRef, InstancesRequest

    from workers import stages
    from workers.settings import Settings

    settings = Settings(data_dir=Path(folder), onnx_threads=1)
    tools = stages.warm(settings)
    ids = [tools.blobs.put(path.read_bytes()) for path in PICTURES]
    requests = [InstancesRequest(image=ImageRef(id=one), files=[]) for one in ids]
    connection.send(0.0)
    while jobs := connection.recv():
        started = time.process_time()
        for k in range(jobs):
            stages.run(requests[k % len(requests)], tools).result.model_dump_json()
        connection.send(time.process_time() - started)


@contextmanager
def _bare(processes: int) -> Iterator[list[Connection]]:
    """Ends of pipes to warm processes."""
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        pipes = [context.Pipe() for _ in range(processes)]
        started = [
            context.Process(target=_compute, args=(theirs, folder), daemon=True)
            for _, theirs in pipes
        ]
        for process in started:
            process.start()
        ours = [end for end, _ in pipes]
        for end in ours:
            end.recv()
        yield ours
        for end in ours:
            end.send(0)
        for process in started:
            process.join()


def _bare_round(ends: list[Connection], jobs: int) -> tuple[float, float]:
    """Jobs a second, and processor time of a job, ms."""
    started = time.perf_counter()
    for end in ends:
        end.send(jobs // len(ends))
    processor_s = sum(end.recv() for end in ends)
    return jobs / (time.perf_counter() - started), 1000 * processor_s / jobs


def _service_round(there: Plant, ids: list[str], jobs: int) -> tuple[float, float]:
    """The same, from the first that is sent to the last that has ended; of all processes of the
    service. Who asks is on this machine too, and does as little as can be done: the processor is to
    be the service's."""
    bodies = [json.dumps({"kind": "instances", "image": {"id": one}, "files": []}) for one in ids]
    left = iter(range(jobs))
    address = urlsplit(there.url).netloc

    def ask_again_and_again(_: int) -> None:
        connection = http.client.HTTPConnection(address, timeout=90)
        for number in left:
            json_type = {"Content-Type": "application/json"}
            connection.request("POST", "/v1/jobs?wait=60", bodies[number % len(bodies)], json_type)
            answer = connection.getresponse().read()
            assert b'"state":"succeeded"' in answer, answer[:1000]
        connection.close()

    started, before_s = time.perf_counter(), there.processor_s()
    senders = 2 * len(there.workers)
    with ThreadPoolExecutor(senders) as threads:
        list(threads.map(ask_again_and_again, range(senders)))
    took_s, processor_s = time.perf_counter() - started, there.processor_s() - before_s
    return jobs / took_s, 1000 * processor_s / jobs


def throughput(jobs: int, processes: int) -> Row:
    """Jobs a second of either, the median of the rounds, and their ratio in percent; the same of
    processor time, which other programs on the machine change little."""
    each = jobs // _ROUNDS
    found: dict[str, list[tuple[float, float]]] = {"bare": [], "service": []}
    changes: dict[str, Any] = {"onnx_threads": 1, "spare_child": False}
    with (
        _bare(processes) as ends,
        plant(workers=processes, **changes) as there,
        httpx.Client(base_url=there.url, timeout=90) as client,
    ):
        ids = [
            client.post("/v1/images", content=path.read_bytes()).json()["id"] for path in PICTURES
        ]
        _bare_round(ends, 3 * processes)
        _service_round(there, ids, 3 * processes)
        for _ in range(_ROUNDS):
            found["bare"].append(_bare_round(ends, each))
            found["service"].append(_service_round(there, ids, each))
    (bare, bare_ms), (service, service_ms) = (
        np.median(found[name], axis=0) for name in ("bare", "service")
    )
    pairs = [100 * s / b for (s, _), (b, _) in zip(found["service"], found["bare"], strict=True)]
    return {
        "jobs": each * _ROUNDS,
        "processes": processes,
        "bare_per_s": round(float(bare), 2),
        "service_per_s": round(float(service), 2),
        "bare_ms": round(float(bare_ms), 1),
        "service_ms": round(float(service_ms), 1),
        "processor_percent": round(float(100 * bare_ms / service_ms), 1),
        "percent": round(float(np.median(pairs)), 1),
        "rounds_percent": [round(pair, 1) for pair in pairs],
    }


def memory(jobs: int, processes: int) -> Row:
    """MB that the service and the worker have at most, each with its children, before and while
    requests come."""
    buffer = BytesIO()
    Image.new("L", (8000, 7900)).save(buffer, "PNG")
    wrong = json.dumps({"kind": "merge_curves", "curves": [{"a": k} for k in range(250_000)]})[
        : 4 * 2**20
    ]
    rows = {}
    with (
        plant(child_memory_mb=_LIMIT_MB) as there,
        httpx.Client(base_url=there.url, timeout=90) as client,
    ):
        rows["at rest"] = there.memory_mb() | {"answered": ""}

        def errors() -> httpx.Response:
            return client.post(
                "/v1/jobs", content=wrong.encode(), headers={"Content-Type": "application/json"}
            )

        def picture() -> httpx.Response:
            image = {"id": client.post("/v1/images", content=buffer.getvalue()).json()["id"]}
            return client.post("/v1/jobs?wait=60", json={"kind": "instances", "image": image})

        for name, ask in {
            "4 MiB, every object wrong": errors,
            "a picture of 63 megapixels": picture,
        }.items():
            with _watched(there) as most:
                answer = ask()
            body = answer.json()
            code = (body.get("problem") or {}).get("code") or body.get("code") or body.get("state")
            rows[name] = {part: round(mb) for part, mb in most.items()} | {
                "answered": f"{answer.status_code} {code}"
            }
    return {"limit_mb": _LIMIT_MB, "cases": rows}


@contextmanager
def _watched(there: Plant) -> Iterator[dict[str, float]]:
    """The most memory of each part meanwhile."""
    most: dict[str, float] = {}
    done = threading.Event()

    def look() -> None:
        while not done.wait(0.02):
            for part, mb in there.memory_mb().items():
                most[part] = max(most.get(part, 0.0), mb)

    thread = threading.Thread(target=look)
    thread.start()
    yield most
    done.set()
    thread.join()


MEASURES = {"throughput": throughput, "memory": memory}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--jobs", type=int, default=240)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("build/bench/throughput.json"))
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    found = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    for name in asked.only.split(",") if asked.only else MEASURES:
        found[name] = MEASURES[name](asked.jobs, asked.processes)
        print(name, json.dumps(found[name]), flush=True)
        asked.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
