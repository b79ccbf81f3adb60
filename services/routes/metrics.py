"""``/metrics`` in Prometheus' text form."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from services import documents
from services.access import Authorized, BackendDep

router = APIRouter(tags=["health"], dependencies=[Authorized])


@router.get("/metrics", response_class=Response, responses=documents.problems())
def metrics(backend: BackendDep) -> Response:
    """Jobs, queues, workers and request durations."""
    return Response(generate_latest(backend.registry), media_type=CONTENT_TYPE_LATEST)
