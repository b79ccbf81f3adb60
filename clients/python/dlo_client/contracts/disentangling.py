"""Plans that undo the crossings of a harness: requests and answers."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Point, Probability, Reply, Taken
from dlo_client.contracts.foreground import ReferencesUsed
from dlo_client.contracts.images import PictureWarnings
from dlo_client.contracts.submission import JobRequest, ModelUsed
from dlo_client.contracts.topology import (
    MOST_PIXELS,
    BranchPoint,
    HarnessSource,
    Name,
    Section,
    SectionCrossing,
    TopologyResult,
)


class ArmBase(Contract):
    """A robot arm's base in the picture's plane; it may lie outside the picture."""

    name: Name = Field(description="what actions call it")
    xy: Point = Field(description="in the picture's plane, pixels; may be outside the picture")
    reach_px: float | None = Field(
        default=None, gt=0, le=1e9, description="default: it reaches everything"
    )
    reach_m: float | None = Field(
        default=None, gt=0, le=100, description="instead of reach_px; needs `m_per_px`"
    )
    m_per_px: float | None = Field(
        default=None, ge=1e-7, le=1, description="meters a pixel where the harness is"
    )

    @model_validator(mode="after")
    def _one_reach(self) -> ArmBase:
        if self.reach_px is not None and self.reach_m is not None:
            raise ValueError("`reach_px` and `reach_m` exclude each other")
        if (self.reach_m is None) != (self.m_per_px is None):
            raise ValueError("`reach_m` and `m_per_px` belong together")
        return self

    @property
    def reach_pixels(self) -> float:
        """Infinite where no reach is given."""
        if self.reach_m is not None and self.m_per_px is not None:
            return self.reach_m / self.m_per_px
        return math.inf if self.reach_px is None else self.reach_px


class Gripper(Contract):
    """The room that a gripper needs beside the strand that it closes on: in pixels, or in meters
    with the scale."""

    width_px: float | None = Field(
        default=None, ge=0.01, le=1e5, description="pixels of the upright picture"
    )
    width_m: float | None = Field(
        default=None, ge=1e-4, le=10, description="meters; needs `m_per_px`"
    )
    m_per_px: float | None = Field(
        default=None, ge=1e-7, le=1, description="meters a pixel where the harness is"
    )

    @model_validator(mode="after")
    def _one_width(self) -> Gripper:
        if (self.width_px is None) == (self.width_m is None):
            raise ValueError("`gripper` needs either `width_px` or `width_m`")
        if (self.width_m is None) != (self.m_per_px is None):
            raise ValueError("`gripper.width_m` and `gripper.m_per_px` belong together")
        return self

    @property
    def pixels(self) -> float:
        if self.width_m is not None and self.m_per_px is not None:
            return self.width_m / self.m_per_px
        return self.width_px or 0.0


class HarnessState(Taken):
    """What planning needs of a ``topology`` result; the result itself fits."""

    width: int = Field(gt=0, le=100_000, description="of the picture, pixels")
    height: int = Field(gt=0, le=100_000, description="of the picture, pixels")
    sections: list[Section] = Field(max_length=300, description="as in the result of `topology`")
    branch_points: list[BranchPoint] = Field(
        max_length=300, description="as in the result of `topology`"
    )
    crossings: list[SectionCrossing] = Field(
        max_length=300, description="as in the result of `topology`"
    )

    @model_validator(mode="after")
    def _ids_fit(self) -> HarnessState:
        if self.width * self.height > MOST_PIXELS:
            raise ValueError(
                f"`width` and height are of a picture of more than {MOST_PIXELS} pixels"
            )
        for what, items in (("sections", self.sections), ("branch_points", self.branch_points)):
            if [i.id for i in items] != list(range(1, len(items) + 1)):
                raise ValueError(f"`{what}`: ids count from 1 in order")
        for section in self.sections:
            if not 2 <= len(section.points_xy) <= 5000:
                raise ValueError(f"`sections`: section {section.id} needs 2 to 5000 points")
            if any(
                b is not None and not 1 <= b <= len(self.branch_points)
                for b in section.branch_points
            ):
                raise ValueError(
                    f"`sections`: section {section.id} names a branch-point that is not there"
                )
        named = [(f"`branch_points`: {b.id}", s) for b in self.branch_points for s in b.sections]
        named += [
            (f"`crossings`: {c.id}", p.section) for c in self.crossings for p in (c.over, c.under)
        ]
        for who, section_id in named:
            if not 1 <= section_id <= len(self.sections):
                raise ValueError(f"{who} names a section that is not there")
        return self


class GripperPose(Reply):
    """``angle_rad`` is along the section, from x towards y; the gripper closes across it. ``arm``:
    who does it."""

    xy: Point = Field(description="between the fingers, pixels")
    angle_rad: float = Field(description="along the section, from x towards y")
    arm: str | None = Field(default=None, description="name of the arm, when bases were given")


class DisentangleAction(Reply):
    """One arm holds, the other turns the piece beyond about that place: pick, follow the arc,
    place."""

    rank: int = Field(ge=1, description="place in the list, from 1; 1 is the best")
    crossing: int = Field(description="id of the crossing that it is for")
    section: int = Field(description="id of the section that is moved")
    about_branch_point: int | None = Field(
        description="id; null when a place along the section is held"
    )
    touching_branch_point: int | None = Field(
        default=None,
        description="id; supposed to be a mere touch, as all that crosses is held at both ends otherwise",
    )
    hold: GripperPose = Field(description="the gripper that keeps still")
    pick: GripperPose = Field(description="where the other gripper grasps")
    trajectory_xy: list[Point] = Field(description="arc of the moving gripper, from pick to place")
    place: GripperPose = Field(description="where it lets go")
    turn_rad: float = Field(description="from x towards y, about the held place")
    crossings_before: int = Field(description="how many crossings the picture has now")
    crossings_after: int = Field(description="counted in the simulation, the piece being rigid")
    passes_over: list[int] = Field(
        description="ids of the sections that the piece is lifted over on its way"
    )
    clearance_px: float = Field(description="least distance to the other sections after the move")
    score: Probability = Field(
        description="probability that it removes so many crossings, arms erring a little"
    )
    why: str = Field(description="the reasons for its rank, in words")


class DisentangleResult(Reply):
    """``status``: ``planned``; ``unsure`` when even the best action more likely fails than works;
    ``no_crossing`` when there is nothing to do; ``no_action`` when nothing helps."""

    kind: Literal["plan_disentangle"] = Field(
        default="plan_disentangle", description="kind of the job"
    )
    width: int = Field(description="of the upright picture, pixels")
    height: int = Field(description="of the upright picture, pixels")
    status: Literal["planned", "unsure", "no_crossing", "no_action"] = Field(
        description="whether there are actions"
    )
    message: str = Field(description="the status in words")
    actions: list[DisentangleAction] = Field(description="best first")
    topology: TopologyResult | None = Field(
        description="what was seen, when a picture was given; where `carried`, its sections, "
        "branch-points and crossings are those of `earlier` as the action left them, also out of view"
    )
    carried: bool = Field(
        default=False, description="the picture agrees with `earlier`, which the plan is made on"
    )
    reference: ReferencesUsed = Field(default_factory=list)
    warnings: PictureWarnings = Field(default_factory=list)
    models: list[ModelUsed] = Field(description="networks that took part")


class DoneAction(Taken):
    """What planning needs of an action that was carried out; a proposed action fits."""

    hold: GripperPose = Field(description="the gripper that kept still")
    turn_rad: float = Field(ge=-7, le=7, description="from x towards y, about the held place")
    crossings_after: int = Field(
        ge=0, le=1000, description="number of them, as the simulation counted"
    )
    score: Probability = Field(description="probability that was stated, 0 to 1")


class CarriedOut(Taken):
    """What a new picture is compared with of an action that was carried out; a proposed action
    fits."""

    hold: GripperPose = Field(description="the gripper that kept still")
    pick: GripperPose = Field(description="where the other gripper grasped")
    turn_rad: float = Field(ge=-7, le=7, description="from x towards y, about the held place")


class Earlier(Contract):
    """What was there before the last action, and that action."""

    topology: HarnessState = Field(
        description="`topology` of the answer that proposed it, in this picture's pixels"
    )
    action: CarriedOut = Field(description="as that answer proposed it")


class Attempt(Contract):
    """An action that was carried out, and what came of it."""

    action: DoneAction = Field(description="as an earlier answer proposed it")
    crossings: int = Field(ge=0, le=1000, description="how many there were after it")


class DisentangleRequest(HarnessSource, JobRequest[DisentangleResult]):
    """A ``topology`` result, or a picture or mask, to ranked dual-arm actions that remove a
    crossing."""

    kind: Literal["plan_disentangle"] = Field(default="plan_disentangle", description="of the job")
    topology: HarnessState | None = Field(default=None, description="instead of a picture")
    arms: list[ArmBase] = Field(
        default_factory=list, max_length=4, description="two or more, or none"
    )
    gripper: Gripper | None = Field(
        default=None, description="default: 1.6 widths of a typical strand of the harness"
    )
    margin_px: float = Field(
        default=0.0, ge=0, le=1e5, description="how far outside the picture the piece may end"
    )
    at_most: int = Field(default=5, ge=1, le=50, description="how many actions are proposed")
    attempts: list[Attempt] = Field(
        default_factory=list,
        max_length=100,
        description="actions so far, in this picture's pixels: scores follow from what they brought",
    )
    earlier: Earlier | None = Field(
        default=None,
        description="before the last action, of the same camera: what is unclear, or out of view, is "
        "known from there; needs a picture",
    )
    files: list[Literal["overlay"]] = Field(
        default=["overlay"], max_length=1, description="to make beside the result"
    )

    @property
    def needs_picture(self) -> bool:
        return self.topology is None

    @model_validator(mode="after")
    def _one_source(self) -> DisentangleRequest:
        if len(self.arms) == 1:
            raise ValueError("`arms` needs two bases or more: one arm holds, the other moves")
        if len({a.name for a in self.arms}) < len(self.arms):
            raise ValueError("`arms`: two have the same name")
        seen = self.mask or self.depth or self.points or self.regions or self.of_a_network
        if self.topology is not None and seen:
            raise ValueError(
                "`topology` already says what is there: only an `image` to draw on may stand beside it"
            )
        if self.topology is not None and self.earlier is not None:
            raise ValueError("`earlier` is compared with a new picture: leave `topology` out")
        return self
