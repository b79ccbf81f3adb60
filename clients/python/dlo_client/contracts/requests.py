"""One request and one result per job kind; :data:`AnyRequest` is their union on ``kind``.

To add a kind: a pair here, a file in ``workers/stages``, a ``case`` there.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.adaptation import AdaptRequest, AdaptResult
from dlo_client.contracts.base import Probability, Reply
from dlo_client.contracts.depth import DepthGiven, TablePlane
from dlo_client.contracts.disentangling import DisentangleRequest, DisentangleResult
from dlo_client.contracts.foreground import ForegroundOptions, ReferencesUsed
from dlo_client.contracts.images import ImageSource, PictureWarnings
from dlo_client.contracts.labelling import LabelTrackedRequest, LabelTrackedResult
from dlo_client.contracts.manipulation import (
    EstimateParametersRequest,
    EstimateParametersResult,
    PlanShapeRequest,
)
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod, MethodParams
from dlo_client.contracts.networks import ImportNetworkRequest, ImportNetworkResult
from dlo_client.contracts.objects import Crossing, Instance, SceneStatus
from dlo_client.contracts.reconstruction import (
    MergeCurvesRequest,
    MergeCurvesResult,
    NextViewRequest,
    NextViewResult,
    ReconstructRequest,
    ReconstructResult,
)
from dlo_client.contracts.shape_plans import PlanShapeResult
from dlo_client.contracts.submission import JobRequest, ModelUsed
from dlo_client.contracts.topology import TopologyRequest, TopologyResult
from dlo_client.contracts.tracking import CableCrossing, TimeSeconds, TrackedCable, TrackState


class NoopResult(Reply):
    kind: Literal["noop"] = Field(default="noop", description="kind of the job")
    held_s: float = Field(description="seconds that the worker was held")


class NoopRequest(JobRequest[NoopResult]):
    """Holds a worker for ``hold_s`` and does nothing: to measure the path and rehearse
    time-outs."""

    kind: Literal["noop"] = Field(default="noop", description="of the job")
    hold_s: float = Field(default=0.0, ge=0, le=60, description="seconds to hold the worker")


class SegmentResult(Reply):
    kind: Literal["segment"] = Field(default="segment", description="kind of the job")
    width: int = Field(description="of the upright picture, pixels")
    height: int = Field(description="of the upright picture, pixels")
    coverage: Probability = Field(description="share of pixels at or above the threshold")
    threshold: Probability = Field(description="from which a pixel counts as foreground")
    reference: ReferencesUsed = Field(default_factory=list)
    warnings: PictureWarnings = Field(default_factory=list)
    models: list[ModelUsed] = Field(description="networks that took part")


class SegmentRequest(ForegroundOptions, JobRequest[SegmentResult]):
    """Picture to foreground probability."""

    kind: Literal["segment"] = Field(default="segment", description="of the job")
    image: ImageSource | None = Field(
        default=None, description="may be left out when an `image` part fills it"
    )
    threshold: Probability | None = Field(default=None, description="default: the network's own")


InstanceFile = Literal["instances", "overlay", "mask"]


class InstancesResult(Reply):
    kind: Literal["instances"] = Field(default="instances", description="kind of the job")
    width: int = Field(description="of the upright picture, pixels")
    height: int = Field(description="of the upright picture, pixels")
    method: InstanceMethod = Field(description="that told the instances apart")
    threshold: Probability = Field(description="from which a pixel was foreground")
    instances: list[Instance] = Field(description="every DLO, ids from 1 in order")
    crossings: list[Crossing] = Field(description="where DLOs cross each other or themselves")
    cables: list[TrackedCable] | None = Field(
        default=None, description="with `previous`: every cable by its lasting id"
    )
    cable_crossings: list[CableCrossing] | None = Field(
        default=None,
        description="with `previous`: where these cables cross, from all frames so far",
    )
    track: TrackState | None = Field(
        default=None, description="with `previous`: that of the next picture"
    )
    table: TablePlane | None = Field(default=None, description="with `depth`, if there is one")
    status: SceneStatus = Field(description="whether the answer can be relied on")
    reference: ReferencesUsed = Field(default_factory=list)
    warnings: PictureWarnings = Field(default_factory=list)
    models: list[ModelUsed] = Field(description="networks that took part")


class InstancesRequest(DepthGiven, ForegroundOptions, JobRequest[InstancesResult]):
    """Picture, foreground mask or depth to DLO instances.

    With ``image`` alone the foreground network makes the mask, unless the picture is one (two
    values) and no ``model`` is named. With ``mask`` (what is not background is DLO: white, 1, 2,
    red) no network looks at the foreground; an ``image`` beside it, of the same size, decides the
    order at crossings. With ``depth`` and its ``intrinsics`` the foreground comes from height and
    color together, or from height alone; the order at crossings too, and every instance has its
    curve in meters.
    """

    kind: Literal["instances"] = Field(default="instances", description="of the job")
    image: ImageSource | None = Field(
        default=None, description="may be left out when an `image` part fills it"
    )
    mask: ImageSource | None = Field(default=None, description="or a `mask` part")
    method: InstanceMethod = Field(
        default=DEFAULT_METHOD, description="how instances are told apart"
    )
    threshold: Probability | None = Field(
        default=None, description="default: the network's own; 0.5 for a mask"
    )
    params: MethodParams | None = Field(default=None, description="those of `method`")
    keep_if_unsure: bool = Field(
        default=False,
        description="the service may keep the picture, for its owner alone, if it is among those that it is least sure "
        "of: `GET /v1/unsure`, `dlo review`",
    )
    points_per_instance: int | None = Field(
        default=None, ge=2, le=2000, description="default: one point about every 5 px"
    )
    previous: TrackState | None = Field(
        default=None,
        description="to follow cables over pictures: the `track` of the last one's result, `{}` for the first",
    )
    time_s: TimeSeconds | None = Field(
        default=None,
        description="when the picture was taken, with `previous`; default: pictures are equally far apart",
    )
    files: list[InstanceFile] = Field(
        default=["instances", "overlay"],
        max_length=3,
        description="to make beside the result; `overlay` is for people and 1280 px long at most",
    )

    @model_validator(mode="before")
    @classmethod
    def _params_of_the_method(cls, data: Any) -> Any:
        """Parameters and method name each other: either may be left out where the other says it."""
        params = data.get("params") if isinstance(data, dict) else None
        if isinstance(params, dict):
            method = data.get("method", params.get("method", DEFAULT_METHOD))
            return {**data, "method": method, "params": {"method": method, **params}}
        return (
            data
            if params is None
            else {"method": getattr(params, "method", DEFAULT_METHOD), **data}
        )

    @model_validator(mode="after")
    def _one_method(self) -> InstancesRequest:
        if self.params is not None and self.params.method != self.method:
            raise ValueError(
                f"`params` are those of {self.params.method}, the method is {self.method}"
            )
        return self

    @model_validator(mode="after")
    def _depth_of_a_camera(self) -> InstancesRequest:
        if self.depth is not None and self.intrinsics is None:
            raise ValueError("`intrinsics` are missing: `depth` needs them")
        return self

    @model_validator(mode="after")
    def _time_of_a_track(self) -> InstancesRequest:
        if self.time_s is not None and self.previous is None:
            raise ValueError("`time_s` has no meaning without `previous`: `{}` begins a track")
        return self

    @model_validator(mode="after")
    def _one_foreground(self) -> InstancesRequest:
        if self.mask is not None and self.of_a_network:
            raise ValueError(
                f"`{self.of_a_network}` has no meaning beside `mask`: the mask is the foreground"
            )
        return self


AnyRequest = Annotated[
    NoopRequest
    | SegmentRequest
    | InstancesRequest
    | ReconstructRequest
    | NextViewRequest
    | MergeCurvesRequest
    | TopologyRequest
    | DisentangleRequest
    | PlanShapeRequest
    | EstimateParametersRequest
    | LabelTrackedRequest
    | ImportNetworkRequest
    | AdaptRequest,
    Field(discriminator="kind"),
]
AnyResult = Annotated[
    NoopResult
    | SegmentResult
    | InstancesResult
    | ReconstructResult
    | NextViewResult
    | MergeCurvesResult
    | TopologyResult
    | DisentangleResult
    | PlanShapeResult
    | EstimateParametersResult
    | LabelTrackedResult
    | ImportNetworkResult
    | AdaptResult,
    Field(discriminator="kind"),
]
JobKind = Literal[
    "noop",
    "segment",
    "instances",
    "reconstruct",
    "next_view",
    "merge_curves",
    "topology",
    "plan_disentangle",
    "plan_shape",
    "estimate_parameters",
    "label_tracked",
    "import_network",
    "adapt",
]
