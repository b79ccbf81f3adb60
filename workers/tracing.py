"""Spans of jobs, children of the request that sent them; nothing where OpenTelemetry is not
configured."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from dlo_client.version import __version__
from opentelemetry import propagate, trace
from opentelemetry.trace import SpanKind

from workers.ledger import Claim

ENDPOINT = "OTEL_EXPORTER_OTLP_ENDPOINT"
_NAME = "dlo-worker"
_EXPORT_EVERY_MS = 1000
_NEEDED = "OTEL_EXPORTER_OTLP_ENDPOINT is set: install requirements/telemetry.txt"


def configured() -> bool:
    """Whether spans are to be exported."""
    return bool(os.environ.get(ENDPOINT))


def require() -> None:
    """Raise ModuleNotFoundError if what exports spans is not installed."""
    try:
        import opentelemetry.exporter.otlp.proto.http.trace_exporter
        import opentelemetry.sdk.trace  # noqa: F401
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(_NEEDED) from error


def begin() -> None:
    """To be called once by a program that runs jobs."""
    if not configured():
        return
    require()
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
    from opentelemetry.sdk.resources import Resource
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor

    resource = Resource.create({"service.name": os.environ.get("OTEL_SERVICE_NAME", _NAME)})
    provider = TracerProvider(resource=resource)
    exporter = OTLPSpanExporter()
    provider.add_span_processor(
        BatchSpanProcessor(exporter, schedule_delay_millis=_EXPORT_EVERY_MS)
    )
    trace.set_tracer_provider(provider)


@contextmanager
def of_job(claim: Claim) -> Iterator[trace.Span]:
    """The span of one attempt."""
    parent = propagate.extract({"traceparent": claim.traceparent} if claim.traceparent else {})
    attributes: dict[str, str | int | float] = {
        "dlo.job_id": claim.job_id,
        "dlo.attempt": claim.attempt,
        "dlo.request_id": claim.request_id,
        "dlo.queue_wait_ms": claim.queue_wait_ms,
    }
    tracer = trace.get_tracer("dlo", __version__)
    with tracer.start_as_current_span(
        "job", parent, SpanKind.CONSUMER, attributes=attributes
    ) as span:
        yield span
