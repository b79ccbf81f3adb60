"""Client of the DLO perception service: cables, wires, hoses and ropes in pictures.

Public is what this file lists, and the error tree in :mod:`dlo_client.errors`. The clients load on first use:
the service and its workers import ``dlo_client.contracts`` and do without an HTTP client.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dlo_client.contracts import (
    AriadnePlusParams,
    ArmBase,
    CameraView,
    Crossing,
    Curve3D,
    DisentangleAction,
    DisentangleRequest,
    DisentangleResult,
    DloObject,
    DrawnBranch,
    EstimateParametersRequest,
    EstimateParametersResult,
    Experience,
    FastDloParams,
    Gripper,
    HarnessDrawing,
    ImageInfo,
    ImageRef,
    Instance,
    InstancesRequest,
    InstancesResult,
    Job,
    JobState,
    LabelTrackedRequest,
    LabelTrackedResult,
    MergeCurvesRequest,
    MoveAction,
    NetworkInfo,
    NextViewRequest,
    NoopRequest,
    NoopResult,
    PinholeIntrinsics,
    PlanLimits,
    PlannedAction,
    PlanShapeRequest,
    PlanShapeResult,
    Problem,
    ReconstructRequest,
    ReconstructResult,
    RopeParameters,
    RtDloParams,
    SectionMatchingParams,
    SegmentRequest,
    SegmentResult,
    Target,
    TopologyRequest,
    TopologyResult,
)

if TYPE_CHECKING:
    from dlo_client.async_client import AsyncClient
    from dlo_client.client import Client
    from dlo_client.errors import (
        APIError,
        ConnectionFailed,
        DLOError,
        InvalidArgument,
        JobCancelled,
        JobFailed,
        WaitTimeout,
    )
    from dlo_client.outcomes import result_of
    from dlo_client.retry import RetryPolicy
    from dlo_client.scan import CameraOnArm, Scan, ScanOptions, ScanResult
    from dlo_client.shape_control import Robot, ShapeController, ShapeOutcome
    from dlo_client.version import __version__
    from dlo_client.webhooks import read_webhook

__all__ = [
    "APIError",
    "AriadnePlusParams",
    "ArmBase",
    "AsyncClient",
    "CameraOnArm",
    "CameraView",
    "Client",
    "ConnectionFailed",
    "Crossing",
    "Curve3D",
    "DLOError",
    "DisentangleAction",
    "DisentangleRequest",
    "DisentangleResult",
    "DloObject",
    "DrawnBranch",
    "EstimateParametersRequest",
    "EstimateParametersResult",
    "Experience",
    "FastDloParams",
    "Gripper",
    "HarnessDrawing",
    "ImageInfo",
    "ImageRef",
    "Instance",
    "InstancesRequest",
    "InstancesResult",
    "InvalidArgument",
    "Job",
    "JobCancelled",
    "JobFailed",
    "JobState",
    "LabelTrackedRequest",
    "LabelTrackedResult",
    "MergeCurvesRequest",
    "MoveAction",
    "NetworkInfo",
    "NextViewRequest",
    "NoopRequest",
    "NoopResult",
    "PinholeIntrinsics",
    "PlanLimits",
    "PlanShapeRequest",
    "PlanShapeResult",
    "PlannedAction",
    "Problem",
    "ReconstructRequest",
    "ReconstructResult",
    "RetryPolicy",
    "Robot",
    "RopeParameters",
    "RtDloParams",
    "Scan",
    "ScanOptions",
    "ScanResult",
    "SectionMatchingParams",
    "SegmentRequest",
    "SegmentResult",
    "ShapeController",
    "ShapeOutcome",
    "Target",
    "TopologyRequest",
    "TopologyResult",
    "WaitTimeout",
    "__version__",
    "read_webhook",
    "result_of",
]

_LOADED_ON_USE = {
    "Robot": "shape_control",
    "ShapeController": "shape_control",
    "ShapeOutcome": "shape_control",
    "read_webhook": "webhooks",
    "APIError": "errors",
    "AsyncClient": "async_client",
    "Client": "client",
    "ConnectionFailed": "errors",
    "DLOError": "errors",
    "InvalidArgument": "errors",
    "JobCancelled": "errors",
    "JobFailed": "errors",
    "CameraOnArm": "scan",
    "RetryPolicy": "retry",
    "Scan": "scan",
    "ScanOptions": "scan",
    "ScanResult": "scan",
    "WaitTimeout": "errors",
    "__version__": "version",
    "result_of": "outcomes",
}


def __getattr__(name: str) -> Any:
    if name not in _LOADED_ON_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LOADED_ON_USE[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
