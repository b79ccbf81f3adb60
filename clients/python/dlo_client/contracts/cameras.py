"""Cameras as a robot cell knows them: intrinsics, and the pose of the camera in the world.

The world frame is the robot's base unless the request means another. Poses are 4 × 4, row by row, and take points
of the camera's frame (z forward, y down, meters) to the world: ``T_world_camera``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, AliasChoices, ConfigDict, Field, model_validator

from dlo_client.contracts.base import Contract, Numbers
from dlo_client.contracts.images import ImageSource

_TOLERANCE = 1e-3
_LARGEST_PX = 100_000
_FARTHEST_M = 1e4

Row = tuple[float, float, float, float]


def _rigid(rows: tuple[Row, Row, Row, Row]) -> tuple[Row, Row, Row, Row]:
    if max(abs(a - b) for a, b in zip(rows[3], (0.0, 0.0, 0.0, 1.0), strict=True)) > _TOLERANCE:
        raise ValueError("the last row of a pose is 0 0 0 1")
    axes = [[rows[i][j] for i in range(3)] for j in range(3)]
    for i in range(3):
        for j in range(3):
            product = sum(a * b for a, b in zip(axes[i], axes[j], strict=True))
            if abs(product - (i == j)) > _TOLERANCE:
                raise ValueError("the upper left 3 × 3 of a pose is a rotation: its columns are not orthonormal")
    (a, b, c), (d, e, f), (g, h, k) = axes
    if a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) < 0:
        raise ValueError("the upper left 3 × 3 of a pose is a rotation: this one is mirrored (determinant -1)")
    if max(abs(row[3]) for row in rows) > _FARTHEST_M:
        raise ValueError("a camera is not that far away: translations are in meters")
    return rows


Pose = Annotated[tuple[Row, Row, Row, Row], AfterValidator(_rigid), Numbers]
"""4 × 4, row by row; its rotation is checked to 1e-3."""

Pixels = Annotated[int, Field(gt=0, le=_LARGEST_PX)]
Focal = Annotated[float, Field(gt=0, le=_LARGEST_PX)]
Center = Annotated[float, Field(ge=-_LARGEST_PX, le=_LARGEST_PX)]
Coefficients = Annotated[list[Annotated[float, Field(ge=-1e3, le=1e3)]], Numbers]
DistortionName = Literal["plumb_bob", "rational_polynomial", "equidistant"]
_COEFFICIENTS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "equidistant": (0, 4)}


class PinholeIntrinsics(Contract):
    """OpenCV's parameters in pixels; ``distortion`` is k1 k2 p1 p2 [k3 [k4 k5 k6]] in OpenCV's order."""

    width: Pixels = Field(description="of the upright picture, pixels")
    height: Pixels = Field(description="of the upright picture, pixels")
    fx: Focal = Field(description="focal length along x, pixels")
    fy: Focal = Field(description="focal length along y, pixels")
    cx: Center = Field(description="principal point, pixels from the center of the first column")
    cy: Center = Field(description="principal point, pixels from the center of the first row")
    distortion: Coefficients = Field(
        default_factory=list, max_length=8, description="k1 k2 p1 p2 [k3 [k4 k5 k6]]; none: no distortion"
    )

    @model_validator(mode="after")
    def _known_count(self) -> PinholeIntrinsics:
        if len(self.distortion) not in (0, 4, 5, 8):
            raise ValueError("distortion has 0, 4, 5 or 8 coefficients")
        return self


class CameraInfo(Contract):
    """ROS's ``sensor_msgs/CameraInfo``, its names in upper (ROS 1) or lower case (ROS 2). Other fields of the
    message are passed over."""

    model_config = ConfigDict(extra="ignore", populate_by_name=True)

    width: Pixels = Field(description="of the upright picture, pixels")
    height: Pixels = Field(description="of the upright picture, pixels")
    K: Annotated[list[float], Numbers] = Field(
        min_length=9,
        max_length=9,
        validation_alias=AliasChoices("K", "k"),
        description="fx 0 cx, 0 fy cy, 0 0 1, row by row, pixels",
    )
    D: Coefficients = Field(
        default_factory=list,
        max_length=8,
        validation_alias=AliasChoices("D", "d"),
        description="as many coefficients as `distortion_model` has",
    )
    distortion_model: DistortionName = Field(default="plumb_bob", description="ROS's name of the lens model")

    @model_validator(mode="after")
    def _usable(self) -> CameraInfo:
        if len(self.D) not in _COEFFICIENTS[self.distortion_model]:
            raise ValueError(f"D has not as many coefficients as {self.distortion_model} needs")
        if not (0 < self.K[0] <= _LARGEST_PX and 0 < self.K[4] <= _LARGEST_PX):
            raise ValueError("K[0] and K[4], the focal lengths, are positive: is this camera calibrated?")
        if any(abs(self.K[i]) > 1e-6 for i in (1, 3, 6, 7)) or abs(self.K[8] - 1) > 1e-6:
            raise ValueError("K is fx 0 cx, 0 fy cy, 0 0 1")
        return self


AnyIntrinsics = PinholeIntrinsics | CameraInfo


class CameraPose(Contract):
    """A camera that could take a picture."""

    intrinsics: AnyIntrinsics = Field(description="PinholeIntrinsics, or a ROS CameraInfo as it is published")
    T_world_camera: Pose = Field(description="4 × 4, row by row: camera (z forward, y down, meters) to world")


class CameraView(CameraPose):
    """A picture and the camera that took it. Intrinsics and pose are those of the upright picture."""

    image: ImageSource | None = Field(default=None, description="may be left out when `image` parts fill it in order")
    name: str | None = Field(default=None, max_length=100, description="what messages call it; default views[n]")
