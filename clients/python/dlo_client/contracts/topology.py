"""Branched DLOs (wire harnesses): their topology, the drawing it may be compared with, and how to
disentangle them.

Indices (``sections``, ``branch_point``, …) are the ids of the result they stand in; ids count from
1.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Point, Probability, Reply, Taken
from dlo_client.contracts.depth import DepthGiven, MetricCenterline, TablePlane
from dlo_client.contracts.foreground import ForegroundOptions, ReferencesUsed
from dlo_client.contracts.images import ImageSource, PictureWarnings
from dlo_client.contracts.submission import JobRequest, ModelUsed

Name = Annotated[str, Field(min_length=1, max_length=100)]
LengthUnit = Literal["px", "mm", "cm", "m", "in"]
EndKind = Literal["branch", "free", "border"]
TopologyStatus = Literal["branched", "plain", "closed", "empty", "unsure", "too_complex"]
_Pixels = Annotated[float, Field(ge=0, le=1e6)]
_MOST_PIXELS = 100_000_000
_MOST_UNLIKE = 1e6
"""Factor between the lengths of two branches of one drawing."""


class SeenPoint(Contract):
    """A point in space as it appears in the picture: where, and how far from the camera."""

    xy: Point = Field(description="in the picture, pixels")
    depth_m: float = Field(ge=1e-3, le=1000, description="distance to the camera along its axis")


class DrawnBranch(Contract):
    """One branch of a drawing: between the points ``a`` and ``b``, which other branches share by
    name."""

    name: Name = Field(description="what the answer calls the sections that are it")
    a: Name = Field(description="name of the point at one end")
    b: Name = Field(description="name of the point at the other end")
    length: float = Field(ge=1e-6, le=1e9, description="in the drawing's unit")


class HarnessDrawing(Contract):
    """The harness as it was designed: a tree of branches. ``connectors`` names points that carry
    one."""

    unit: LengthUnit = Field(default="mm", description="of all lengths of the drawing")
    branches: list[DrawnBranch] = Field(
        min_length=1, max_length=64, description="a tree: they join at points of the same name"
    )
    connectors: list[Name] = Field(
        default_factory=list, max_length=65, description="names of the points that carry one"
    )
    px_per_unit: float | None = Field(
        default=None,
        ge=1e-6,
        le=1e6,
        description="pixels for a unit of the drawing; default: estimated from the match",
    )

    @model_validator(mode="after")
    def _is_a_tree(self) -> HarnessDrawing:
        names = [b.name for b in self.branches]
        if len(set(names)) < len(names):
            raise ValueError("`branches`: two branches have the same name")
        lengths = [b.length for b in self.branches]
        if max(lengths) > _MOST_UNLIKE * min(lengths):
            raise ValueError(
                f"`branches`: their lengths, {min(lengths):g} to {max(lengths):g}, are not of one drawing"
            )
        group = {p: p for b in self.branches for p in (b.a, b.b)}

        def root(point: str) -> str:
            while group[point] != point:
                point = group[point]
            return point

        for branch in self.branches:
            if root(branch.a) == root(branch.b):
                raise ValueError(
                    f"`branches`: {branch.name} closes a cycle; a harness drawing is a tree"
                )
            group[root(branch.a)] = root(branch.b)
        if len({root(p) for p in group}) > 1:
            raise ValueError(
                "`branches`: the drawing is in several pieces; describe one harness a drawing"
            )
        unknown = [c for c in self.connectors if c not in group]
        if unknown:
            raise ValueError(f"`connectors`: no branch ends at {unknown[0]}")
        return self


class TopologyEdge(Reply):
    """Nodes ``a`` and ``b`` (indices into ``nodes_xy``, from 0) follow one another on a section."""

    a: int = Field(ge=0, description="index of a node, from 0")
    b: int = Field(ge=0, description="index of the node that follows")
    score: Probability = Field(description="probability of the link")


class SectionPlace(Reply):
    """A place on a section: ``u`` from 0 at its first to 1 at its last point, by arc length."""

    section: int = Field(ge=1, description="its id")
    u: Probability = Field(
        description="share of the arc length: 0 at its first to 1 at its last point"
    )


class Section(MetricCenterline):
    """What lies between two branch-points or ends; it passes straight on over and under
    crossings."""

    id: int = Field(ge=1, description="from 1, in the order of the list")
    points_xy: list[Point] = Field(description="ordered, at equal arc length")
    width_px: float = Field(gt=0, le=1e6, description="typical width along it")
    length_px: float = Field(ge=0, le=1e9, description="arc length")
    end_widths_px: tuple[_Pixels, _Pixels] = Field(
        description="widest near either end: a connector shows there"
    )
    ends: tuple[EndKind, EndKind] = Field(description="at the first and at the last point")
    branch_points: tuple[int | None, int | None] = Field(
        description="ids of the branch-points at its ends"
    )
    closed: bool = Field(description="a ring: the last point joins the first")
    score: Probability = Field(
        description="share of the section that lies on foreground; the rest bridges gaps"
    )
    name: str | None = Field(
        default=None, description="of the drawn branch that it is, when a drawing was given"
    )


class BranchPoint(Reply):
    """Where sections part. A section that comes back to it is listed twice."""

    id: int = Field(ge=1, description="from 1, in the order of the list")
    xy: Point = Field(description="its place, pixels")
    sections: list[int] = Field(
        description="ids of the sections that part here; one that comes back is listed twice"
    )
    score: Probability = Field(description="probability that this is a branch-point")
    name: str | None = Field(default=None, description="of the drawn point that it is")


class SectionCrossing(Reply):
    """One section passes over another, or over itself."""

    id: int = Field(ge=1, description="from 1, in the order of the list")
    xy: Point = Field(description="where the sections meet, pixels")
    over: SectionPlace = Field(description="the place on the section on top")
    under: SectionPlace = Field(description="the place on the section below")
    score: Probability = Field(
        description="probability that this is a crossing and no branch-point"
    )
    order_score: Probability = Field(
        description="confidence in which is over; 0.5 when it is not known"
    )


class BranchMatch(Reply):
    """A drawn branch and the sections that are it; ``cost`` 0 for a length as drawn, about 1 at a
    factor of e."""

    name: str = Field(description="of the drawn branch")
    sections: list[int] = Field(description="ids of the sections that are it, end to end")
    length_px: float = Field(description="their length together")
    expected_px: float = Field(description="its drawn length times `px_per_unit`")
    cost: float = Field(description="0 for a length as drawn, about 1 at a factor of e")


class DrawingMatch(Reply):
    """The picture against the drawing. The scale is ``px_per_unit`` of the request, or estimated:
    the ratio of seen to drawn length that makes most of the matched branches fit (``scale_from``
    says which)."""

    branches: list[BranchMatch] = Field(description="drawn branches that were found")
    missing: list[str] = Field(description="drawn branches that were not found")
    extra: list[int] = Field(description="ids of the sections that are no drawn branch")
    px_per_unit: float | None = Field(
        description="scale: pixels of the picture for a unit of the drawing"
    )
    scale_from: Literal["request", "estimate"] = Field(description="where that scale comes from")
    ambiguous: bool = Field(
        description="another assignment fits nearly as well, e.g. branches of equal length"
    )
    cost: float = Field(
        description="mean cost of the matched branches; missing and extra ones count 1 each"
    )


class TopologyResult(Reply):
    """The graph of what is seen. ``status``: ``branched``; ``plain`` without a branch-point;
    ``closed`` only rings; ``empty``; ``unsure`` where nothing is found because most of the
    foreground is too wide for a DLO; ``too_complex`` for a mask that is no picture of DLOs."""

    kind: Literal["topology"] = Field(default="topology", description="kind of the job")
    width: int = Field(gt=0, description="of the upright picture, pixels")
    height: int = Field(gt=0, description="of the upright picture, pixels")
    status: TopologyStatus = Field(description="what kind of graph it is")
    message: str = Field(description="the status in words")
    threshold: Probability = Field(description="from which a pixel was foreground")
    nodes_xy: list[Point] = Field(description="evenly spaced along the sections")
    node_angles_rad: list[float] = Field(
        description="predicted direction of the strand at each node, 0 to pi"
    )
    node_branch_scores: list[Probability] = Field(
        description="of each node: probability of a branch-point there"
    )
    node_crossing_scores: list[Probability] = Field(
        description="of each node: probability of a crossing there"
    )
    edges: list[TopologyEdge] = Field(description="nodes that follow one another")
    sections: list[Section] = Field(
        description="between branch-points and ends, ids from 1 in order"
    )
    branch_points: list[BranchPoint] = Field(description="ids from 1 in order")
    crossings: list[SectionCrossing] = Field(description="ids from 1 in order")
    match: DrawingMatch | None = Field(
        default=None, description="against the drawing, when one was given"
    )
    reference: ReferencesUsed = Field(default_factory=list)
    table: TablePlane | None = Field(
        default=None, description="with `depth` and `intrinsics`, if there is one"
    )
    warnings: PictureWarnings = Field(default_factory=list)
    models: list[ModelUsed] = Field(description="networks that took part")


class _HarnessSource(DepthGiven, ForegroundOptions):
    """Where the foreground comes from, and what else is seen. ``depth`` without ``intrinsics`` only
    shows which section is on top."""

    image: ImageSource | None = Field(
        default=None, description="may be left out when an `image` part fills it"
    )
    mask: ImageSource | None = Field(
        default=None, description="or a `mask` part; what is not background is DLO"
    )
    threshold: Probability | None = Field(
        default=None, description="default: the network's own; 0.5 for a mask"
    )
    points: list[SeenPoint] = Field(
        default_factory=list, max_length=50_000, description="or points in space"
    )

    @model_validator(mode="after")
    def _one_foreground(self) -> _HarnessSource:
        if self.mask is not None and self.of_a_network:
            raise ValueError(
                f"`{self.of_a_network}` has no meaning beside `mask`: the mask is the foreground"
            )
        return self


class TopologyRequest(_HarnessSource, JobRequest[TopologyResult]):
    """Picture, or foreground mask, to the topology of the harnesses in it.

    An ``image`` beside a ``mask`` helps to tell crossings from branch-points and shows which
    section is on top; so do ``depth`` and ``points``. With a ``drawing`` the answer names the
    branches and says what is missing or extra.
    """

    kind: Literal["topology"] = Field(default="topology", description="of the job")
    drawing: HarnessDrawing | None = Field(
        default=None, description="the harness as it was designed, to compare with"
    )
    files: list[Literal["overlay", "mask"]] = Field(
        default=["overlay"], max_length=2, description="to make beside the result"
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
        if self.width * self.height > _MOST_PIXELS:
            raise ValueError(
                f"`width` and height are of a picture of more than {_MOST_PIXELS} pixels"
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
    topology: TopologyResult | None = Field(description="what was seen, when a picture was given")
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


class Attempt(Contract):
    """An action that was carried out, and what came of it."""

    action: DoneAction = Field(description="as an earlier answer proposed it")
    crossings: int = Field(ge=0, le=1000, description="how many there were after it")


class DisentangleRequest(_HarnessSource, JobRequest[DisentangleResult]):
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
        return self
