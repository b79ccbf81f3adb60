"""What Prometheus is told. Jobs, queues and workers are read from the queue server at each scrape.

So every replica of the service says the same about them; request durations are each replica's own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from workers.queue import JobQueue

_BUCKETS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class RequestDurations:
    """Seconds from a request's first byte to the end of its answer, by route template and status class."""

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
        yield self._depth()
        yield self._workers()
        yield self._jobs()

    def _depth(self) -> Metric:
        gauge = GaugeMetricFamily("dlo_queue_depth", "Jobs that wait, by queue", labels=("queue",))
        for name, depth in self._queue.depth().items():
            gauge.add_metric((name,), depth)
        return gauge

    def _workers(self) -> Metric:
        gauge = GaugeMetricFamily("dlo_workers", "Live workers, by what they do", labels=("state",))
        states = Counter(_state(worker.ready, worker.busy) for worker in self._queue.workers())
        for state in ("starting", "idle", "busy"):
            gauge.add_metric((state,), states[state])
        return gauge

    def _jobs(self) -> Metric:
        text = "Jobs that have entered a state, by kind; every job enters `queued`"
        counter = CounterMetricFamily("dlo_jobs", text, labels=("kind", "state"))
        for (kind, state), number in sorted(self._queue.counts().items()):
            counter.add_metric((kind, state), number)
        return counter


def _state(ready: bool, busy: bool) -> str:
    if not ready:
        return "starting"
    return "busy" if busy else "idle"
