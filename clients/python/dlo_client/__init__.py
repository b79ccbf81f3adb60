"""Client of the DLO perception service: cables, wires, hoses and ropes in pictures.

Public is what this file lists, and the error tree in :mod:`dlo_client.errors`. The clients load on first use:
the service and its workers import ``dlo_client.contracts`` and do without an HTTP client.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dlo_client.contracts import (
    AriadnePlusParams,
    Crossing,
    FastDloParams,
    ImageInfo,
    ImageRef,
    Instance,
    InstancesRequest,
    InstancesResult,
    Job,
    JobState,
    NetworkInfo,
    NoopRequest,
    NoopResult,
    Problem,
    RtDloParams,
    SectionMatchingParams,
    SegmentRequest,
    SegmentResult,
)

if TYPE_CHECKING:
    from dlo_client.async_client import AsyncClient
    from dlo_client.client import Client
    from dlo_client.errors import APIError, ConnectionFailed, DLOError, JobCancelled, JobFailed, WaitTimeout
    from dlo_client.outcomes import result_of
    from dlo_client.retry import RetryPolicy

__all__ = [
    "APIError",
    "AriadnePlusParams",
    "AsyncClient",
    "Client",
    "ConnectionFailed",
    "Crossing",
    "DLOError",
    "FastDloParams",
    "ImageInfo",
    "ImageRef",
    "Instance",
    "InstancesRequest",
    "InstancesResult",
    "Job",
    "JobCancelled",
    "JobFailed",
    "JobState",
    "NetworkInfo",
    "NoopRequest",
    "NoopResult",
    "Problem",
    "RetryPolicy",
    "RtDloParams",
    "SectionMatchingParams",
    "SegmentRequest",
    "SegmentResult",
    "WaitTimeout",
    "result_of",
]

_LOADED_ON_USE = {
    "APIError": "errors",
    "AsyncClient": "async_client",
    "Client": "client",
    "ConnectionFailed": "errors",
    "DLOError": "errors",
    "JobCancelled": "errors",
    "JobFailed": "errors",
    "RetryPolicy": "retry",
    "WaitTimeout": "errors",
    "result_of": "outcomes",
}


def __getattr__(name: str) -> Any:
    if name not in _LOADED_ON_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LOADED_ON_USE[name]}"), name)
