"""How full the disk of pictures and results is, for Prometheus and the page of the operators."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector


class DiskCollector(Collector):
    """Looks when asked; a folder that is not there yet will be on the disk of the nearest one that
    is."""

    def __init__(self, folder: Path, reserve_bytes: int) -> None:
        self._folder = folder
        self._reserve_bytes = reserve_bytes

    def describe(self) -> list[Metric]:
        """Nothing: so that registering looks at no disk."""
        return []

    def collect(self) -> Iterator[Metric]:
        folder = self._folder.absolute()
        existing = next(place for place in (folder, *folder.parents) if place.exists())
        usage = shutil.disk_usage(existing)
        yield _gauge("dlo_disk_bytes", "Size of the disk of pictures and results", usage.total)
        yield _gauge("dlo_disk_free_bytes", "What is free of it", usage.free)
        yield _gauge("dlo_disk_reserve_bytes", "What uploads leave free", self._reserve_bytes)


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(name, text, value=value)
