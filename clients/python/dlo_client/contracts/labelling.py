"""Kind of thesis section 2.5: labels for many pictures from one stroke of a tracked pen a DLO
(DLO-WSL)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Numbers, Point, Probability, Reply
from dlo_client.contracts.cameras import AnyIntrinsics, CameraView, Pose
from dlo_client.contracts.objects import Crossing, Endpoint, MaskRLE
from dlo_client.contracts.submission import JobRequest, ModelUsed

_Meters = Annotated[float, Field(ge=-1e4, le=1e4)]
_SHORTEST_M = 1e-3
LabelFile = Literal["labels", "overlay"]


class Stroke(Contract):
    """One DLO as the pen marked it, from end to end: a click every few centimeters is enough."""

    points_m: Annotated[list[tuple[_Meters, _Meters, _Meters]], Numbers] = Field(
        min_length=2,
        max_length=5000,
        description="x, y, z of the pen's tip, in the tracker's frame",
    )
    thickness_m: float = Field(ge=1e-5, le=1, description="diameter of the DLO")
    name: str | None = Field(default=None, max_length=100, description="what the labels call it")

    @model_validator(mode="after")
    def _a_line(self) -> Stroke:
        if sum(math.dist(a, b) for a, b in pairwise(self.points_m)) < _SHORTEST_M:
            raise ValueError("`points_m` holds one place only: a stroke is longer than 1 mm")
        return self


class TrackedInstance(Reply):
    """One DLO in one picture. ``id`` is the number of its stroke from 1, the same in every
    picture."""

    id: int = Field(ge=1, description="number of its stroke, from 1")
    name: str | None = Field(default=None, description="of its stroke")
    score: Probability = Field(description="mean trust of its corrections, 0 to 1; not calibrated")
    centerline_xy: list[Point] = Field(description="ordered, end to end, pixels")
    width_px: float = Field(gt=0, description="mean over the visible part")
    endpoints: list[Endpoint] = Field(description="at the first and at the last point")
    mask_rle: MaskRLE = Field(description="visible pixels: at a crossing the nearer DLO owns them")
    offset_px: list[float] = Field(
        description="how far each centerline point was moved across the DLO"
    )
    trust: list[Probability] = Field(
        description="of each correction, 0 to 1; low where something covers the DLO"
    )


class TrackedLabels(Reply):
    """The labels of one picture; a DLO that is outside of it is missing in ``instances``."""

    name: str = Field(description="of the view")
    width: int = Field(description="of the upright picture, pixels")
    height: int = Field(description="of the upright picture, pixels")
    instances: list[TrackedInstance] = Field(
        description="DLOs in this picture; one outside of it is missing"
    )
    crossings: list[Crossing] = Field(description="where DLOs cross in this picture")
    moved_px: float = Field(
        description="median distance of all corrections: what calibration and hand were off by"
    )
    intrinsics: AnyIntrinsics = Field(description="as in the request")
    T_world_camera: Pose = Field(description="as in the request, meters")


class LabelTrackedResult(Reply):
    kind: Literal["label_tracked"] = Field(default="label_tracked", description="kind of the job")
    views: list[TrackedLabels] = Field(
        description="labels of each picture, in the order of the request"
    )
    warnings: list[str] = Field(description="what limits the labels")
    models: list[ModelUsed] = Field(description="networks that took part")


class LabelTrackedRequest(JobRequest[LabelTrackedResult]):
    """Pictures from known poses and the strokes of a tracked pen, to instance labels of every
    picture."""

    kind: Literal["label_tracked"] = Field(default="label_tracked", description="of the job")
    views: list[CameraView] = Field(
        min_length=1, max_length=64, description="pictures and the cameras that took them"
    )
    strokes: list[Stroke] = Field(min_length=1, max_length=100, description="one a DLO")
    T_world_tracker: Pose | None = Field(
        default=None, description="the tracker's frame; default: it is the world's"
    )
    correct: bool = Field(default=True, description="off: the strokes as they were drawn, smoothed")
    agree: bool = Field(
        default=True,
        description="corrections agree along the DLO and across views; off: thesis 2.5.3",
    )
    measure_width: bool = Field(
        default=True, description="each view's widths are measured; off: thickness as given"
    )
    find_ends: bool = Field(
        default=True,
        description="ends are put where the pictures show them; off: where the strokes have them",
    )
    spacing_px: float = Field(
        default=8.0, ge=2, le=50, description="between corrected points, in the nearest view"
    )
    files: list[LabelFile] = Field(
        default=["labels", "overlay"],
        max_length=2,
        description="to make beside the result, one of each a picture",
    )
