"""A depth map beside the picture, and what it adds to an answer."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from dlo_client.contracts.base import Contract, Reply
from dlo_client.contracts.cameras import AnyIntrinsics, Pose
from dlo_client.contracts.images import ImageSource

Meters = Annotated[float, Field(ge=-1e6, le=1e6)]
Point3 = tuple[Meters, Meters, Meters]
_Positive = Annotated[float, Field(ge=0, le=1e6)]
_Variance = Annotated[float, Field(ge=-1e9, le=1e9)]
Covariance = tuple[_Variance, _Variance, _Variance, _Variance, _Variance, _Variance]


class DepthGiven(Contract):
    """What a request may carry about depth."""

    depth: ImageSource | None = Field(
        default=None,
        description="or a `depth` part: distances along the camera's axis, registered to the picture and of its size: "
        "PNG or TIFF of 16-bit gray in millimeters, or TIFF of floats in meters; 0 and NaN are unknown. Or a point "
        "cloud, a point (meters, in the camera's frame) for each pixel: PCD with rows, or NPY of floats (H, W, 3)",
    )
    intrinsics: AnyIntrinsics | None = Field(
        default=None,
        description="of the upright picture, with `depth`: PinholeIntrinsics, or a ROS CameraInfo; those "
        "of a point cloud follow from its points",
    )
    T_world_camera: Pose | None = Field(
        default=None,
        description="with `depth`: camera (z forward, y down, meters) to world; default: answers are in "
        "the camera's frame",
    )


class TablePlane(Reply):
    """The plane on which things lie: its points x satisfy `normal · x = offset_m`."""

    normal: Point3 = Field(description="of unit length, towards the camera")
    offset_m: Meters = Field(description="meters")
    sigma_m: float = Field(description="standard deviation of the depth's noise across it, meters")
    share: float = Field(description="share of the known depths that are on it")


class MetricCenterline(Reply):
    """What an instance or a section gains by depth; None where there is none, or too little along
    it."""

    curve_m: list[Point3] | None = Field(
        default=None, description="the centerline's points in meters, one for each of its pixels"
    )
    radius_m: _Positive | None = Field(
        default=None, description="typical, from the width in the picture"
    )
    sigma_m: list[_Positive] | None = Field(
        default=None, description="one a point: standard deviation in its worst direction, meters"
    )
    covariance_m2: list[Covariance] | None = Field(
        default=None, description="one a point, across the curve: xx, xy, xz, yy, yz, zz"
    )
