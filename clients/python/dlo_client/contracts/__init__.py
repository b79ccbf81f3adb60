"""What travels: the one definition that the service, the workers and the SDK share."""

from dlo_client.contracts.base import Contract, Point, Probability
from dlo_client.contracts.images import BlobId, ImageInfo, ImagePart, ImageRef, ImageSource
from dlo_client.contracts.jobs import (
    AnyJob,
    FieldProblem,
    FileRef,
    Job,
    JobEvent,
    JobPage,
    JobState,
    NetworkInfo,
    Problem,
)
from dlo_client.contracts.objects import Crossing, Endpoint, Instance, MaskRLE, Spline, StrandPosition
from dlo_client.contracts.requests import (
    AnyRequest,
    AnyResult,
    InstancesRequest,
    InstancesResult,
    JobKind,
    NoopRequest,
    NoopResult,
    RtDloParams,
    SegmentRequest,
    SegmentResult,
)
from dlo_client.contracts.submission import JobRequest, ModelUsed, Priority

__all__ = [
    "AnyJob",
    "AnyRequest",
    "AnyResult",
    "BlobId",
    "Contract",
    "Crossing",
    "Endpoint",
    "FieldProblem",
    "FileRef",
    "ImageInfo",
    "ImagePart",
    "ImageRef",
    "ImageSource",
    "Instance",
    "InstancesRequest",
    "InstancesResult",
    "Job",
    "JobEvent",
    "JobKind",
    "JobPage",
    "JobRequest",
    "JobState",
    "MaskRLE",
    "ModelUsed",
    "NetworkInfo",
    "NoopRequest",
    "NoopResult",
    "Point",
    "Priority",
    "Probability",
    "Problem",
    "RtDloParams",
    "SegmentRequest",
    "SegmentResult",
    "Spline",
    "StrandPosition",
]
