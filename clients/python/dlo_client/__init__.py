"""Client of the DLO perception service: cables, wires, hoses and ropes in pictures.

    with Client("http://127.0.0.1:8000") as client:
        result = client.run(InstancesRequest(), "photo.jpg")       # a path, an array, an image, a file, an address
        job = client.submit(TopologyRequest(), "harness.jpg")      # goes on meanwhile
        result = client.result(job)

``Client`` and ``AsyncClient`` have the same methods; a request's class names what it takes:
``help(InstancesRequest)``. Errors are below ``DLOError``: ``help(dlo_client.errors)`` draws the
tree. ``state(result)`` gives arrays of a fixed shape.

Public is what this file lists. The clients load on first use:
the service and its workers import ``dlo_client.contracts`` and do without an HTTP client.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dlo_client.contracts import (
    AnyJob,
    AriadnePlusParams,
    ArmBase,
    CameraView,
    Clip,
    Crossing,
    Curve3D,
    DisentangleAction,
    DisentangleRequest,
    DisentangleResult,
    DloObject,
    DrawnBranch,
    Earlier,
    EstimateParametersRequest,
    EstimateParametersResult,
    Experience,
    FastDloParams,
    FrameResult,
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
    Peg,
    PinholeIntrinsics,
    PlanGripper,
    PlanLimits,
    PlannedAction,
    PlanShapeRequest,
    PlanShapeResult,
    Problem,
    ReconstructRequest,
    ReconstructResult,
    RopeParameters,
    Route,
    RouteStop,
    RtDloParams,
    SectionMatchingParams,
    SegmentRequest,
    SegmentResult,
    StreamedFrame,
    TableEdge,
    Target,
    TopologyRequest,
    TopologyResult,
    TrackedCable,
    TrackInfo,
    TrackOptions,
    TrackState,
)
from dlo_client.contracts.frames import Output, OutputFrame, Plane, RobotPose, RobotPoses
from dlo_client.contracts.recipes import CameraBody, Recipe, RecipeBody, Sample, StoredCamera

if TYPE_CHECKING:
    from dlo_client.async_client import AsyncClient
    from dlo_client.async_loops import AsyncScan, AsyncShapeController
    from dlo_client.client import Client
    from dlo_client.errors import (
        APIError,
        Conflict,
        ConnectionFailed,
        DLOError,
        Gone,
        InvalidArgument,
        InvalidRequest,
        JobCancelled,
        JobFailed,
        NotFound,
        QueueFull,
        ServiceFault,
        StorageFull,
        Unauthorized,
        Unavailable,
        UnexpectedReply,
        WaitTimeout,
    )
    from dlo_client.outcomes import result_of
    from dlo_client.pictures import opencv
    from dlo_client.policy import PolicyState, state
    from dlo_client.retry import RetryPolicy
    from dlo_client.scan import CameraOnArm, Scan, ScanOptions, ScanResult
    from dlo_client.shape_control import Robot, ShapeController, ShapeOutcome
    from dlo_client.track import AsyncTrack, Track
    from dlo_client.version import __version__
    from dlo_client.webhooks import read_webhook

__all__ = [
    "APIError",
    "AnyJob",
    "AriadnePlusParams",
    "ArmBase",
    "AsyncClient",
    "AsyncScan",
    "AsyncShapeController",
    "AsyncTrack",
    "CameraBody",
    "CameraOnArm",
    "CameraView",
    "Client",
    "Clip",
    "Conflict",
    "ConnectionFailed",
    "Crossing",
    "Curve3D",
    "DLOError",
    "DisentangleAction",
    "DisentangleRequest",
    "DisentangleResult",
    "DloObject",
    "DrawnBranch",
    "Earlier",
    "EstimateParametersRequest",
    "EstimateParametersResult",
    "Experience",
    "FastDloParams",
    "FrameResult",
    "Gone",
    "Gripper",
    "HarnessDrawing",
    "ImageInfo",
    "ImageRef",
    "Instance",
    "InstancesRequest",
    "InstancesResult",
    "InvalidArgument",
    "InvalidRequest",
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
    "NotFound",
    "Output",
    "OutputFrame",
    "Peg",
    "PinholeIntrinsics",
    "PlanGripper",
    "PlanLimits",
    "PlanShapeRequest",
    "PlanShapeResult",
    "Plane",
    "PlannedAction",
    "PolicyState",
    "Problem",
    "QueueFull",
    "Recipe",
    "RecipeBody",
    "ReconstructRequest",
    "ReconstructResult",
    "RetryPolicy",
    "Robot",
    "RobotPose",
    "RobotPoses",
    "RopeParameters",
    "Route",
    "RouteStop",
    "RtDloParams",
    "Sample",
    "Scan",
    "ScanOptions",
    "ScanResult",
    "SectionMatchingParams",
    "SegmentRequest",
    "SegmentResult",
    "ServiceFault",
    "ShapeController",
    "ShapeOutcome",
    "StorageFull",
    "StoredCamera",
    "StreamedFrame",
    "TableEdge",
    "Target",
    "TopologyRequest",
    "TopologyResult",
    "Track",
    "TrackInfo",
    "TrackOptions",
    "TrackState",
    "TrackedCable",
    "Unauthorized",
    "Unavailable",
    "UnexpectedReply",
    "WaitTimeout",
    "__version__",
    "opencv",
    "read_webhook",
    "result_of",
    "state",
]

_LOADED_ON_USE = {
    "AsyncTrack": "track",
    "Track": "track",
    "APIError": "errors",
    "AsyncClient": "async_client",
    "AsyncScan": "async_loops",
    "AsyncShapeController": "async_loops",
    "CameraOnArm": "scan",
    "Client": "client",
    "Conflict": "errors",
    "ConnectionFailed": "errors",
    "DLOError": "errors",
    "Gone": "errors",
    "InvalidArgument": "errors",
    "InvalidRequest": "errors",
    "JobCancelled": "errors",
    "JobFailed": "errors",
    "NotFound": "errors",
    "PolicyState": "policy",
    "QueueFull": "errors",
    "RetryPolicy": "retry",
    "Robot": "shape_control",
    "Scan": "scan",
    "ScanOptions": "scan",
    "ScanResult": "scan",
    "ServiceFault": "errors",
    "ShapeController": "shape_control",
    "ShapeOutcome": "shape_control",
    "StorageFull": "errors",
    "Unauthorized": "errors",
    "Unavailable": "errors",
    "UnexpectedReply": "errors",
    "WaitTimeout": "errors",
    "__version__": "version",
    "opencv": "pictures",
    "read_webhook": "webhooks",
    "result_of": "outcomes",
    "state": "policy",
}


def __getattr__(name: str) -> Any:
    if name not in _LOADED_ON_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LOADED_ON_USE[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
