"""Time of a no-op job from submit to its end, through the queue and one warm worker, without HTTP.

``python -m tests.benchmarks.bench_queue [--jobs N]`` starts its own queue server and worker.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from dlo_client.contracts import NoopRequest

from tests.processes import WorkerProcess
from workers.embedded import EmbeddedQueue
from workers.queue import JobQueue
from workers.settings import Settings


def time_one(queue: JobQueue) -> float:
    """Milliseconds from submit to the end event."""
    started = time.perf_counter()
    job, _ = queue.submit(NoopRequest())
    last = "0"
    state = job.state
    while not state.final:
        for event in queue.events(job.id, last, 5000):
            last, state = event.id, event.state
    queue.get(job.id)
    return (time.perf_counter() - started) * 1000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=300)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, EmbeddedQueue(Path(folder) / "queue") as server:
        settings = Settings(redis_url=server.url, data_dir=Path(folder), log_level="WARNING")
        queue = JobQueue(settings)
        worker = WorkerProcess(settings, "bench", "workers")
        try:
            worker.wait_ready()
            times_ms = sorted(time_one(queue) for _ in range(arguments.jobs))
        finally:
            worker.close()
    percentiles = statistics.quantiles(times_ms, n=20)
    print(
        f"no-op job, {len(times_ms)} times: p50 {percentiles[9]:.1f} ms, p95 {percentiles[18]:.1f} ms"
    )


if __name__ == "__main__":
    main()
