"""``/metrics`` in Prometheus' text form."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from services import documents
from services.access import BackendDep, Reader

router = APIRouter(tags=["health"])


@router.get("/metrics", response_class=Response, responses=documents.problems(403, 429))
def metrics(_: Reader, backend: BackendDep) -> Response:
    """Jobs, queues, workers and request durations."""
    return Response(generate_latest(backend.registry), media_type=CONTENT_TYPE_LATEST)
