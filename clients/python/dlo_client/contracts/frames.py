"""Places of an answer as a robot's controller takes them: in a frame, a unit and a rotation
convention.

Strategy: a *place* is where a gripper would go: its x axis is along the DLO, its z axis goes into
the surface (the approach). The service finds the places of a result, brings them into ``frame``,
and writes them as the robot does.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Numbers, Probability, Reply
from dlo_client.contracts.cameras import FARTHEST_M, CameraPose, Pose

Unit = Literal["m", "mm"]
RotationConvention = Literal[
    "quaternion_xyzw",
    "quaternion_wxyz",
    "rotation_vector",
    "kuka_abc",
    "abb",
    "fanuc_wpr",
    "ur",
    "yaskawa",
    "staubli",
    "kawasaki_oat",
]
"""``ur`` is a rotation vector in radians, ``abb`` a quaternion w x y z; the other makers' are three
angles in degrees: ``kuka_abc`` about z, the new y, the new x; ``fanuc_wpr`` and ``yaskawa`` about
the fixed x, y, z; ``staubli`` about x, the new y, the new z; ``kawasaki_oat`` about z, the new y,
the new z."""

EULER_AXES: dict[RotationConvention, str] = {
    "kuka_abc": "ZYX",
    "fanuc_wpr": "xyz",
    "yaskawa": "xyz",
    "staubli": "XYZ",
    "kawasaki_oat": "ZYZ",
}
"""Axes in the order in which each maker lists its angles, in SciPy's letters: capital ones turn
with the body."""

SCALAR_FIRST = {"quaternion_xyzw": False, "quaternion_wxyz": True, "abb": True}
"""The conventions that are quaternions, and whether the real part comes first."""

FRAME = r"^[A-Za-z][A-Za-z0-9_.-]{0,63}$"
_Direction = Annotated[float, Field(ge=-1e3, le=1e3)]
_PLACED = ("instances", "topology", "reconstruct", "merge_curves", "plan_disentangle", "plan_shape")
_IN_PIXELS = ("instances", "topology", "plan_disentangle")


class Plane(Contract):
    """The surface that DLOs are on, in the world: all points ``offset_m`` from the origin along
    ``normal``."""

    normal: Annotated[tuple[_Direction, _Direction, _Direction], Numbers] = Field(
        default=(0.0, 0.0, 1.0),
        description="away from the surface; its length has no meaning, it has no unit",
    )
    offset_m: float = Field(
        default=0.0,
        ge=-FARTHEST_M,
        le=FARTHEST_M,
        description="distance to the origin along `normal`, meters",
    )

    @model_validator(mode="after")
    def _has_direction(self) -> Plane:
        if math.hypot(*self.normal) < 1e-6:
            raise ValueError("`normal` has no direction")
        return self


class OutputFrame(Contract):
    """How places are written: the frame that they are in, the unit of positions, the rotation
    convention."""

    frame: str = Field(
        default="world",
        pattern=FRAME,
        description="`world`, `camera` (of the first picture), or a name of your own with `T_world_frame`",
    )
    T_world_frame: Pose | None = Field(
        default=None,
        description="4 × 4, row by row, meters: the named frame in the world, as a fixture",
    )
    unit: Unit = Field(default="m", description="of positions: meters or millimeters")
    rotation: RotationConvention = Field(
        default="quaternion_xyzw",
        description="how rotations are written; angles of robot makers are in degrees",
    )

    @model_validator(mode="after")
    def _frame_is_known(self) -> OutputFrame:
        if (self.frame in ("world", "camera")) == (self.T_world_frame is not None):
            hint = (
                "has one of its own" if self.T_world_frame else "is needed for a frame of your own"
            )
            raise ValueError(f"`T_world_frame` {hint}: `frame` is {self.frame!r}")
        return self


class Output(OutputFrame):
    """What is needed to state an answer's places as robot poses; the poses are in the job's
    ``poses``."""

    camera: CameraPose | None = Field(
        default=None, description="took the picture; needed where the answer is in pixels"
    )
    plane: Plane = Field(
        default_factory=Plane, description="the surface that the DLOs are on; default z = 0"
    )
    T_flange_tool: Pose | None = Field(
        default=None,
        description="4 × 4, row by row, meters: poses are then the flange's, so that the tool is at the place",
    )

    def check_fits(self, kind: str, *, in_space: bool = False) -> None:
        """Raises ValueError for a ``kind`` without places, or one in pixels without a camera;
        ``in_space``: depth comes along, which makes points of the pixels."""
        if kind not in _PLACED:
            raise ValueError(
                f"`output` has no meaning for {kind}: it has no places; {', '.join(_PLACED)} have"
            )
        if kind in _IN_PIXELS and self.camera is None and not in_space:
            raise ValueError(f"`output` needs its `camera` here: the answer of {kind} is in pixels")
        if self.frame == "camera" and self.camera is None and kind != "reconstruct":
            raise ValueError(f"`output` needs its `camera`: the frame of {kind} is no camera's")


class RobotPose(Reply):
    """One place: where a gripper would go, x along the DLO, z into the surface."""

    role: Literal["first", "middle", "last", "hold", "pick", "place"] = Field(
        description="`first`, `middle`, `last` of a DLO; `hold`, `pick`, `place` of the best action"
    )
    id: int = Field(
        ge=0, description="of the DLO, section or action in the result; curves count from 1"
    )
    position: tuple[float, float, float] = Field(description="x, y, z in `unit` of the poses")
    rotation: list[float] = Field(
        description="in the rotation convention of the poses: radians, degrees or no unit"
    )
    score: Probability = Field(
        description="probability of the DLO, section or action; 1 where the result gives none"
    )


class RobotPoses(Reply):
    """The places of a result in one frame, unit and convention."""

    frame: str = Field(description="that the poses are in")
    unit: Unit = Field(description="of positions: meters or millimeters")
    rotation: RotationConvention = Field(description="how rotations are written")
    of: Literal["tool", "flange"] = Field(description="what has to be brought there")
    poses: list[RobotPose] = Field(description="in the order of the result")
    warnings: list[str] = Field(
        default_factory=list, description="places that are left out, and why"
    )
