"""Kind of thesis section 2.5: labels for many pictures from one stroke of a tracked pen a DLO (DLO-WSL)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Numbers, Point, Probability, Reply
from dlo_client.contracts.cameras import AnyIntrinsics, CameraView, Pose
from dlo_client.contracts.objects import Crossing, Endpoint, MaskRLE
from dlo_client.contracts.submission import JobRequest, ModelUsed

_Meters = Annotated[float, Field(ge=-1e4, le=1e4)]
LabelFile = Literal["labels", "overlay"]


class Stroke(Contract):
    """One DLO as the pen marked it, from end to end: a click every few centimeters is enough."""

    points_m: Annotated[list[tuple[_Meters, _Meters, _Meters]], Numbers] = Field(
        min_length=2, max_length=5000, description="x, y, z of the pen's tip, in the tracker's frame"
    )
    thickness_m: float = Field(gt=0, le=1, description="diameter of the DLO")
    name: str | None = Field(default=None, max_length=100)

    @model_validator(mode="after")
    def _a_line(self) -> Stroke:
        if len(set(self.points_m)) < 2:
            raise ValueError("points_m holds one place only")
        return self


class TrackedInstance(Reply):
    """One DLO in one picture. ``id`` is the number of its stroke from 1, the same in every picture."""

    id: int = Field(ge=1)
    name: str | None = None
    score: Probability = Field(description="mean trust of its corrections; not calibrated")
    centerline_xy: list[Point]
    width_px: float = Field(gt=0, description="mean over the visible part")
    endpoints: list[Endpoint]
    mask_rle: MaskRLE = Field(description="visible pixels: at a crossing the nearer DLO owns them")
    offset_px: list[float] = Field(description="how far each centerline point was moved across the DLO")
    trust: list[Probability] = Field(description="of each correction; low where something covers the DLO")


class TrackedLabels(Reply):
    """The labels of one picture; a DLO that lies outside of it is missing in ``instances``."""

    name: str
    width: int
    height: int
    instances: list[TrackedInstance]
    crossings: list[Crossing]
    moved_px: float = Field(description="median distance of all corrections: what calibration and hand were off by")
    intrinsics: AnyIntrinsics
    T_world_camera: Pose


class LabelTrackedResult(Reply):
    kind: Literal["label_tracked"] = "label_tracked"
    views: list[TrackedLabels]
    warnings: list[str]
    models: list[ModelUsed]


class LabelTrackedRequest(JobRequest[LabelTrackedResult]):
    """Pictures from known poses and the strokes of a tracked pen, to instance labels of every picture."""

    kind: Literal["label_tracked"] = "label_tracked"
    views: list[CameraView] = Field(min_length=1, max_length=64)
    strokes: list[Stroke] = Field(min_length=1, max_length=100)
    T_world_tracker: Pose | None = Field(default=None, description="the tracker's frame; default: it is the world's")
    correct: bool = Field(default=True, description="off: the strokes as they were drawn, smoothed")
    agree: bool = Field(default=True, description="corrections agree along the DLO and across views; off: thesis 2.5.3")
    measure_width: bool = Field(default=True, description="each view's widths are measured; off: thickness as given")
    find_ends: bool = Field(
        default=True, description="ends are put where the pictures show them; off: where the strokes have them"
    )
    spacing_px: float = Field(default=8.0, ge=2, le=50, description="between corrected points, in the nearest view")
    files: list[LabelFile] = Field(default=["labels", "overlay"], max_length=2)
