"""Cameras as a robot cell knows them: intrinsics, and the pose of the camera in the world.

The world frame is the robot's base unless the request means another. Poses are 4 × 4, row by row,
and take points of the camera's frame (z forward, y down, meters) to the world: ``T_world_camera``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    AliasChoices,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
)

from dlo_client.contracts.base import Contract, Numbers, Taken
from dlo_client.contracts.images import ImageSource

_TOLERANCE = 1e-3
_LARGEST_PX = 100_000
FARTHEST_M = 1e4

Row = tuple[float, float, float, float]


def _rigid(rows: tuple[Row, Row, Row, Row]) -> tuple[Row, Row, Row, Row]:
    if max(abs(a - b) for a, b in zip(rows[3], (0.0, 0.0, 0.0, 1.0), strict=True)) > _TOLERANCE:
        raise ValueError("the last row of a pose is 0 0 0 1")
    axes = [[rows[i][j] for i in range(3)] for j in range(3)]
    for i in range(3):
        for j in range(3):
            product = sum(a * b for a, b in zip(axes[i], axes[j], strict=True))
            if abs(product - (i == j)) > _TOLERANCE:
                raise ValueError(
                    "the upper left 3 × 3 of a pose is a rotation: its columns are not orthonormal"
                )
    (a, b, c), (d, e, f), (g, h, k) = axes
    if a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) < 0:
        raise ValueError(
            "the upper left 3 × 3 of a pose is a rotation: this one is mirrored (determinant -1)"
        )
    if max(abs(row[3]) for row in rows) > FARTHEST_M:
        raise ValueError("a camera is not that far away: translations are in meters")
    return rows


Pose = Annotated[tuple[Row, Row, Row, Row], AfterValidator(_rigid), Numbers]
"""4 × 4, row by row; its rotation is checked to 1e-3."""

Pixels = Annotated[int, Field(gt=0, le=_LARGEST_PX)]
Focal = Annotated[float, Field(gt=0, le=_LARGEST_PX)]
Center = Annotated[float, Field(ge=-_LARGEST_PX, le=_LARGEST_PX)]
Coefficients = Annotated[list[Annotated[float, Field(ge=-1e3, le=1e3)]], Numbers]
DistortionName = Literal["plumb_bob", "rational_polynomial", "equidistant"]
_COEFFICIENTS = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (0, 4, 5, 8, 12, 14),
    "equidistant": (0, 4),
}
_OTHER_NAMES = {"": "plumb_bob", "none": "plumb_bob", "fisheye": "equidistant"}
"""What some drivers write."""
_WIDEST = 28.0
"""Tangent of 88°: what is seen farther from the axis has no place in a plane before the camera."""
_SQUAREST = 10.0
"""Ratio of the sides of a pixel that no camera exceeds."""


def _ros_name(given: object) -> object:
    return _OTHER_NAMES.get(given, given) if isinstance(given, str) else given


def _check_optics(
    width: int, height: int, focal: tuple[float, float], center: tuple[float, float]
) -> None:
    """Raises ValueError for a camera that cannot be, with the unit that the numbers may be in."""
    (fx, fy), (cx, cy) = focal, center
    if fx < width / (2 * _WIDEST) or fy < height / (2 * _WIDEST):
        unit = (
            "multiply fx and cx by the width, fy and cy by the height"
            if max(fx, fy) < 10
            else "are they in pixels?"
        )
        raise ValueError(
            f"`fx` {fx:g} and `fy` {fy:g} are too few pixels for {width} × {height}: {unit}"
        )
    if max(fx / fy, fy / fx) > _SQUAREST:
        raise ValueError(
            f"`fx` {fx:g} and `fy` {fy:g} are of pixels that are {max(fx / fy, fy / fx):g} times longer"
        )
    if 0 < cx <= 1 and 0 < cy <= 1 and min(width, height) > _SQUAREST:
        text = "are in shares of the picture: multiply cx by the width and cy by the height"
        raise ValueError(f"`cx` {cx:g} and `cy` {cy:g} {text}")
    if abs(cx - width / 2) > _WIDEST * fx or abs(cy - height / 2) > _WIDEST * fy:
        raise ValueError(
            f"`cx` {cx:g} and `cy` {cy:g} are so far from the picture that it lies beside the camera"
        )


def _check_count(name: str, count: int, model: DistortionName) -> None:
    if count not in _COEFFICIENTS[model]:
        *most, last = map(str, _COEFFICIENTS[model])
        raise ValueError(
            f"`{name}` of {model} has {', '.join(most)} or {last} coefficients, not {count}"
        )


class PinholeIntrinsics(Contract):
    """OpenCV's parameters in pixels; ``distortion`` in OpenCV's order: k1 k2 p1 p2 [k3 [k4 k5 k6
    [s1 s2 s3 s4 [tx ty]]]], or k1 k2 k3 k4 of ``equidistant`` (OpenCV's fisheye)."""

    width: Pixels = Field(description="of the upright picture, pixels")
    height: Pixels = Field(description="of the upright picture, pixels")
    fx: Focal = Field(description="focal length along x, pixels")
    fy: Focal = Field(description="focal length along y, pixels")
    cx: Center = Field(description="principal point, pixels from the center of the first column")
    cy: Center = Field(description="principal point, pixels from the center of the first row")
    distortion: Coefficients = Field(
        default_factory=list,
        max_length=14,
        description="as many coefficients as the lens has; none: no distortion",
    )
    distortion_model: DistortionName | None = Field(
        default=None,
        description="ROS's name; default: of the polynomial with so many coefficients, never `equidistant`",
    )

    @model_validator(mode="after")
    def _usable(self) -> PinholeIntrinsics:
        _check_count("distortion", len(self.distortion), self.lens)
        _check_optics(self.width, self.height, (self.fx, self.fy), (self.cx, self.cy))
        return self

    @property
    def lens(self) -> DistortionName:
        """The model that ``distortion`` is of."""
        return self.distortion_model or (
            "plumb_bob" if len(self.distortion) <= 5 else "rational_polynomial"
        )

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures that this camera takes."""
        return self.width, self.height


class RegionOfInterest(Contract):
    """ROS's ``sensor_msgs/RegionOfInterest``: the part that is read out, in pixels of the full
    resolution. A width and height of 0 is all of it."""

    model_config = ConfigDict(extra="ignore")

    x_offset: int = Field(default=0, ge=0, le=_LARGEST_PX, description="its first column, pixels")
    y_offset: int = Field(default=0, ge=0, le=_LARGEST_PX, description="its first row, pixels")
    width: int = Field(default=0, ge=0, le=_LARGEST_PX, description="its columns")
    height: int = Field(default=0, ge=0, le=_LARGEST_PX, description="its rows")


class CameraInfo(Contract):
    """ROS's ``sensor_msgs/CameraInfo``, its names in upper (ROS 1) or lower case (ROS 2).

    As in REP 104, ``width``, ``height``, ``K`` and ``roi`` are of the full resolution; the picture
    is the ``roi``, reduced by ``binning_x`` and ``binning_y``. Other fields of the message are
    passed over.
    """

    model_config = ConfigDict(extra="ignore", populate_by_name=True)

    width: Pixels = Field(description="of the full resolution, pixels")
    height: Pixels = Field(description="of the full resolution, pixels")
    K: Annotated[list[float], Numbers] = Field(
        min_length=9,
        max_length=9,
        validation_alias=AliasChoices("K", "k"),
        description="fx 0 cx, 0 fy cy, 0 0 1, row by row, pixels",
    )
    D: Coefficients = Field(
        default_factory=list,
        max_length=14,
        validation_alias=AliasChoices("D", "d"),
        description="as many coefficients as `distortion_model` has",
    )
    distortion_model: Annotated[DistortionName, BeforeValidator(_ros_name)] = Field(
        default="plumb_bob", description="ROS's name of the lens model"
    )
    binning_x: int = Field(
        default=0, ge=0, le=64, description="columns read as one; 0 and 1: every pixel"
    )
    binning_y: int = Field(
        default=0, ge=0, le=64, description="rows read as one; 0 and 1: every pixel"
    )
    roi: RegionOfInterest = Field(
        default_factory=RegionOfInterest, description="what is read out; default all of it"
    )

    @model_validator(mode="after")
    def _usable(self) -> CameraInfo:
        _check_count("D", len(self.D), self.distortion_model)
        if not (0 < self.K[0] <= _LARGEST_PX and 0 < self.K[4] <= _LARGEST_PX):
            raise ValueError(
                "`K`[0] and K[4], the focal lengths, are positive: is this camera calibrated?"
            )
        if any(abs(self.K[i]) > 1e-6 for i in (1, 3, 6, 7)) or abs(self.K[8] - 1) > 1e-6:
            raise ValueError("`K` is fx 0 cx, 0 fy cy, 0 0 1")
        if max(abs(self.K[2]), abs(self.K[5])) > _LARGEST_PX:
            raise ValueError("`K`[2] and K[5], the principal point, are too far from the picture")
        _check_optics(self.width, self.height, (self.K[0], self.K[4]), (self.K[2], self.K[5]))
        x, y, width, height = self._read_out
        if x + width > self.width or y + height > self.height:
            size = f"{self.width} × {self.height}"
            raise ValueError(
                f"`roi` reaches beyond `width` × `height`, {size}: by REP 104 these are the full resolution"
            )
        if min(self.picture_size) < 1:
            raise ValueError("`binning_x` and `binning_y` leave no picture")
        return self

    @property
    def _read_out(self) -> tuple[int, int, int, int]:
        """x, y, width and height of the ``roi``, in pixels of the full resolution."""
        roi = self.roi
        if not roi.width and not roi.height:
            return 0, 0, self.width, self.height
        return roi.x_offset, roi.y_offset, roi.width, roi.height

    @property
    def _binning(self) -> tuple[int, int]:
        return max(self.binning_x, 1), max(self.binning_y, 1)

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures that this camera takes."""
        _, _, width, height = self._read_out
        by_x, by_y = self._binning
        return width // by_x, height // by_y

    def as_taken(self) -> PinholeIntrinsics:
        """Those of the picture, with ``roi`` and binning applied; centers of pixels are at whole
        numbers."""
        x, y, _, _ = self._read_out
        (by_x, by_y), (width, height) = self._binning, self.picture_size
        return PinholeIntrinsics(
            width=width,
            height=height,
            fx=self.K[0] / by_x,
            fy=self.K[4] / by_y,
            cx=(self.K[2] - x + 0.5) / by_x - 0.5,
            cy=(self.K[5] - y + 0.5) / by_y - 0.5,
            distortion=self.D,
            distortion_model=self.distortion_model,
        )


AnyIntrinsics = PinholeIntrinsics | CameraInfo


class CameraPose(Taken):
    """A camera that could take a picture. A view of an answer fits."""

    intrinsics: AnyIntrinsics = Field(
        description="PinholeIntrinsics, or a ROS CameraInfo as it is published"
    )
    T_world_camera: Pose = Field(
        description="4 × 4, row by row: camera (z forward, y down, meters) to world"
    )


class CameraView(CameraPose):
    """A picture and the camera that took it. Intrinsics and pose are those of the upright
    picture."""

    image: ImageSource | None = Field(
        default=None, description="may be left out when `image` parts fill it in order"
    )
    name: str | None = Field(
        default=None, max_length=100, description="what messages call it; default views.n"
    )
