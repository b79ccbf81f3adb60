"""Recipes: numbered, versioned requests that a controller runs with pictures alone; cameras: stored
calibrations."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Numbers, Reply
from dlo_client.contracts.cameras import AnyIntrinsics, Pose
from dlo_client.contracts.frames import OutputFrame, Plane
from dlo_client.contracts.images import ImageRef

LARGEST_NUMBER = 65_535
"""Of a recipe: 16 bits, as controllers have them."""

MOST_PICTURES = 64
CAMERA_NAME = r"^[a-z0-9][a-z0-9_.-]{0,63}$"

FlangePose = Annotated[
    list[Annotated[float, Field(ge=-1e7, le=1e7)]], Field(min_length=6, max_length=7), Numbers
]
"""x, y, z and the rotation, in the unit and convention of the recipe's ``output``."""


class Sample(Contract):
    """A picture that a recipe is tried with, and where the flange was."""

    image: ImageRef = Field(description="uploaded before; kept as long as the recipe")
    flange: FlangePose | None = Field(
        default=None,
        description="x, y, z, rotation of the flange, in the unit of `output`; for a camera on the arm",
    )


class RecipeBody(Contract):
    """What a recipe is made of: ``PUT /v1/recipes/{number}``."""

    name: str = Field(min_length=1, max_length=100, description="for people")
    request: dict[str, Any] = Field(
        description="a request of any `kind` without its pictures; `views` may leave out intrinsics and poses "
        "where `camera` is named"
    )
    camera: str | None = Field(
        default=None, pattern=CAMERA_NAME, description="name of a stored camera"
    )
    output: OutputFrame | None = Field(
        default=None, description="how places are stated; default: no robot poses"
    )
    samples: list[Sample] = Field(
        default_factory=list,
        max_length=MOST_PICTURES,
        description="pictures for a dry run, kept with the recipe",
    )

    @model_validator(mode="after")
    def _no_second_output(self) -> RecipeBody:
        if "output" in self.request:
            raise ValueError("`request` has an `output` of its own: state it beside the request")
        return self


class Recipe(Reply):
    """A stored recipe; versions of one number count up from 1 and do not change."""

    number: int = Field(
        ge=0, le=LARGEST_NUMBER, description="the number that controllers call it by"
    )
    version: int = Field(ge=1, description="counts up with every change")
    name: str = Field(description="for people")
    created_at: datetime = Field(description="of this version")
    author: str = Field(
        default="", description="name of the API key that stored it; empty without keys"
    )
    request: dict[str, Any] = Field(description="the request without its pictures")
    camera: str | None = Field(default=None, description="name of a stored camera")
    output: OutputFrame | None = Field(default=None, description="how places are stated")
    samples: list[Sample] = Field(default_factory=list, description="pictures for a dry run")


class RecipeUsed(Reply):
    """Which recipe a job was made by."""

    number: int = Field(ge=0, le=LARGEST_NUMBER, description="number of the recipe")
    version: int = Field(ge=1, description="version of the recipe, as it was then")


class RunInput(Contract):
    """What a run of a recipe brings beside its parts, or instead of them."""

    images: list[ImageRef] = Field(
        default_factory=list, max_length=MOST_PICTURES, description="uploaded pictures, in order"
    )
    mask: ImageRef | None = Field(default=None, description="an uploaded mask")
    depth: ImageRef | None = Field(default=None, description="an uploaded depth map")
    flange: list[FlangePose] = Field(
        default_factory=list,
        max_length=MOST_PICTURES,
        description="x, y, z, rotation of the flange, one a picture, in the unit of `output`",
    )


class CameraBody(Contract):
    """A calibration: ``PUT /v1/cameras/{name}``. Give the pose in the world, or on the flange; or
    neither."""

    intrinsics: AnyIntrinsics = Field(
        description="PinholeIntrinsics, or a ROS CameraInfo as it is published"
    )
    T_world_camera: Pose | None = Field(
        default=None, description="4 × 4, row by row, meters: of a camera that stands still"
    )
    T_flange_camera: Pose | None = Field(
        default=None, description="4 × 4, row by row, meters: of a camera on the robot's flange"
    )
    T_flange_tool: Pose | None = Field(
        default=None,
        description="4 × 4, row by row, meters: the gripper; poses are then the flange's",
    )
    plane: Plane = Field(
        default_factory=Plane, description="the surface that the DLOs are on; default z = 0"
    )
    sigma_m: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="standard deviation of the hand-eye translation, meters",
    )
    sigma_rad: float | None = Field(
        default=None,
        ge=0,
        le=3.2,
        description="standard deviation of the hand-eye rotation, radians",
    )

    @model_validator(mode="after")
    def _one_mount(self) -> CameraBody:
        if self.T_world_camera is not None and self.T_flange_camera is not None:
            raise ValueError(
                "`T_flange_camera` and T_world_camera: a camera is on the flange, or stands still"
            )
        return self


class StoredCamera(Reply):
    """A stored calibration; versions of one name count up from 1 and do not change."""

    name: str = Field(description="what recipes call it")
    version: int = Field(ge=1, description="counts up with every change")
    created_at: datetime = Field(description="of this version")
    author: str = Field(
        default="", description="name of the API key that stored it; empty without keys"
    )
    camera: CameraBody = Field(description="the calibration")
