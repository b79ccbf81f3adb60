"""What Prometheus reads. Jobs, queues and workers are read from the queue server at each scrape.

So every replica of the service exports the same about them; request durations are each replica's
own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import TypeVar

from dlo_client.version import __version__
from prometheus_client import CollectorRegistry, Histogram, PlatformCollector, ProcessCollector
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from workers.measures import COUNTERS, HISTOGRAMS, Measures
from workers.queue import JobQueue, WorkerInfo

T = TypeVar("T")
_BUCKETS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


def registry(queue: JobQueue) -> CollectorRegistry:
    """Everything but request durations."""
    made = CollectorRegistry()
    made.register(QueueCollector(queue))
    ProcessCollector(registry=made)
    PlatformCollector(registry=made)
    return made


class RequestDurations:
    """Seconds from a request's first byte to the end of its answer, by route template and status
    class."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self._histogram = Histogram(
            "dlo_http_request_seconds",
            "Duration of HTTP requests",
            ("method", "route", "status"),
            buckets=_BUCKETS_S,
            registry=registry,
        )

    def observe(self, method: str, route: str, status: int, seconds: float) -> None:
        known = method if method in _METHODS else "other"
        self._histogram.labels(known, route, f"{status // 100}xx").observe(seconds)


class QueueCollector(Collector):
    """What the queue server knows, read when asked."""

    def __init__(self, queue: JobQueue) -> None:
        self._queue = queue

    def describe(self) -> list[Metric]:
        """Nothing: so that registering does not ask the queue."""
        return []

    def collect(self) -> Iterator[Metric]:
        yield self._by_queue("dlo_queue_depth", "Jobs that wait, by queue", self._queue.depth())
        oldest = "Seconds that the job that waits longest has waited, by queue; 0 where none waits"
        yield self._by_queue("dlo_queue_oldest_seconds", oldest, self._queue.oldest_s())
        taken = GaugeMetricFamily("dlo_queue_server_bytes", "Memory of the queue server")
        taken.add_metric((), self._queue.server_bytes())
        yield taken
        yield self._jobs()
        yield from _workers(self._queue.workers())
        yield from _measured(self._queue.measures())

    def _by_queue(self, name: str, text: str, values: dict[str, int] | dict[str, float]) -> Metric:
        gauge = GaugeMetricFamily(name, text, labels=("queue",))
        for queue, value in values.items():
            gauge.add_metric((queue,), value)
        return gauge

    def _jobs(self) -> Metric:
        text = "Jobs that have entered a state, by kind; every job enters `queued`"
        counter = CounterMetricFamily("dlo_jobs", text, labels=("kind", "state"))
        for (kind, state), number in sorted(self._queue.counts().items()):
            counter.add_metric((kind, state), number)
        return counter


def _workers(workers: list[WorkerInfo]) -> Iterator[Metric]:
    states = Counter(_state(worker) for worker in workers)
    gauge = GaugeMetricFamily("dlo_workers", "Live workers, by what they do", labels=("state",))
    for state in ("starting", "idle", "busy"):
        gauge.add_metric((state,), states[state])
    yield gauge
    memory = GaugeMetricFamily(
        "dlo_worker_memory_bytes", "Memory of a worker's child", labels=("worker",)
    )
    for worker in workers:
        memory.add_metric((worker.name,), worker.memory_mb * 2**20)
    yield memory
    versions = Counter({("service", __version__): 1})
    versions.update(("worker", worker.version) for worker in workers)
    text = "Processes of each version, as this replica of the service sees them"
    info = GaugeMetricFamily("dlo_version", text, labels=("part", "version"))
    for labels, number in sorted(versions.items()):
        info.add_metric(labels, number)
    yield info


def _measured(measures: Measures) -> Iterator[Metric]:
    for name, (text, labels) in HISTOGRAMS.items():
        histogram = HistogramMetricFamily(f"dlo_job_{name}_seconds", text, labels=labels)
        for (_, *values), observed in _named(measures.histograms, name):
            histogram.add_metric(values, observed.cumulative(), observed.sum_s)
        yield histogram
    for name, (text, labels) in COUNTERS.items():
        counter = CounterMetricFamily(_EXPORTED.get(name, f"dlo_jobs_{name}"), text, labels=labels)
        for (_, *values), number in _named(measures.counters, name):
            counter.add_metric(values, number)
        yield counter


def _named(values: Mapping[tuple[str, ...], T], name: str) -> list[tuple[tuple[str, ...], T]]:
    return sorted((item for item in values.items() if item[0][0] == name), key=lambda item: item[0])


_EXPORTED = {
    "owner": "dlo_owner_jobs",
    "owner_seconds": "dlo_owner_seconds",
    "webhook": "dlo_webhooks",
}


def _state(worker: WorkerInfo) -> str:
    if not worker.ready:
        return "starting"
    return "busy" if worker.busy else "idle"
