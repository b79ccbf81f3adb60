"""A request can be followed to its job: in logs by its id, in traces by its trace."""

from __future__ import annotations

import pytest
from dlo_client.contracts import NoopResult
from opentelemetry import trace
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

from services import telemetry
from workers import tracing

TRACE = "0af7651916cd43dd8448eb211c80319c"
SENT = f"00-{TRACE}-b7ad6b7169203331-01"


@pytest.fixture(scope="module")
def spans():
    """What the process exports from now on: a provider can be set once."""
    exporter = InMemorySpanExporter()
    provider = TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    trace.set_tracer_provider(provider)
    return exporter


def submit(client, ledger, **headers):
    job = client.post("/v1/jobs", json={"kind": "noop"}, headers=headers).json()
    return ledger.claim(job["id"], "w")


def test_a_job_carries_the_id_of_its_request(client, ledger):
    assert submit(client, ledger, **{"X-Request-ID": "robot-7/42"}).request_id == "robot-7/42"
    assert submit(client, ledger).request_id, "one of our own where none was sent"


def test_the_span_of_a_job_is_in_the_trace_of_its_request(client, ledger, spans):
    claim = submit(client, ledger, traceparent=SENT)
    assert claim.traceparent.split("-")[1] == TRACE
    with tracing.of_job(claim):
        pass
    ledger.succeed(claim, NoopResult(held_s=0), [], {})
    request, job = (
        span for span in spans.get_finished_spans() if span.context.trace_id == int(TRACE, 16)
    )
    assert request.attributes["http.route"] == "/v1/jobs"
    assert job.parent.span_id == request.context.span_id
    assert job.attributes["dlo.job_id"] == claim.job_id


def test_probes_are_not_traced(client, spans):
    spans.clear()
    for path in ("/healthz", "/readyz", "/metrics"):
        client.get(path)
    assert spans.get_finished_spans() == ()


def test_where_it_is_configured_what_exports_has_to_be_installed(monkeypatch):
    monkeypatch.setenv(tracing.ENDPOINT, "http://127.0.0.1:1")
    assert telemetry.configuration()["auto_configure"] is True
    monkeypatch.setitem(__import__("sys").modules, "opentelemetry.sdk.trace", None)
    with pytest.raises(ModuleNotFoundError, match=r"requirements/telemetry\.txt"):
        telemetry.configuration()
