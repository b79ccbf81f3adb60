"""What ties a job to the request that sent it, and OpenTelemetry where it is configured.

Spans and metrics of HTTP are FastAPI's own. They are exported when ``OTEL_EXPORTER_OTLP_ENDPOINT``
is set and ``requirements/telemetry.txt`` is installed; without, the API of OpenTelemetry does
nothing.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Any

import structlog
from fastapi.telemetry import TelemetryConfig
from opentelemetry import propagate

from workers import tracing
from workers.record import Origin

_PROBES = ("/healthz", "/readyz", "/metrics")


def configuration() -> TelemetryConfig:
    """For FastAPI; raises ModuleNotFoundError where it is configured and not installed."""
    if tracing.configured():
        tracing.require()
    return TelemetryConfig(
        auto_configure=tracing.configured(), operation_spans=False, exclude=_is_probe
    )


def origin(owner: str) -> Origin:
    """Of a job that the request at hand sends."""
    carrier: dict[str, str] = {}
    propagate.inject(carrier)
    request_id = structlog.contextvars.get_contextvars().get("request_id", "")
    return Origin(owner, str(request_id), carrier.get("traceparent", ""))


def _is_probe(scope: MutableMapping[str, Any]) -> bool:
    return scope.get("path") in _PROBES
