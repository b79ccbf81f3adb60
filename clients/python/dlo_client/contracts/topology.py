"""Branched DLOs (wire harnesses): their topology, the drawing it may be compared with, and how to
disentangle them.

Indices (``sections``, ``branch_point``, …) are the ids of the result they stand in; ids count from
1.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Point, Probability, Reply
from dlo_client.contracts.depth import DepthGiven, MetricCenterline, TablePlane
from dlo_client.contracts.foreground import ForegroundOptions, ReferencesUsed
from dlo_client.contracts.images import ImageSource, PictureWarnings
from dlo_client.contracts.submission import JobRequest, ModelUsed

Name = Annotated[str, Field(min_length=1, max_length=100)]
LengthUnit = Literal["px", "mm", "cm", "m", "in"]
EndKind = Literal["branch", "free", "border"]
TopologyStatus = Literal["branched", "plain", "closed", "empty", "unsure", "too_complex"]
_Pixels = Annotated[float, Field(ge=0, le=1e6)]
MOST_PIXELS = 100_000_000
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
    """What is between two branch-points or ends; it passes straight on over and under
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
    states which)."""

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


class HarnessSource(DepthGiven, ForegroundOptions):
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
    def _one_foreground(self) -> HarnessSource:
        if self.mask is not None and self.of_a_network:
            raise ValueError(
                f"`{self.of_a_network}` has no meaning beside `mask`: the mask is the foreground"
            )
        return self


class TopologyRequest(HarnessSource, JobRequest[TopologyResult]):
    """Picture, or foreground mask, to the topology of the harnesses in it.

    An ``image`` beside a ``mask`` helps to tell crossings from branch-points and shows which
    section is on top; so do ``depth`` and ``points``. With a ``drawing`` the answer names the
    branches and states what is missing or extra.
    """

    kind: Literal["topology"] = Field(default="topology", description="of the job")
    drawing: HarnessDrawing | None = Field(
        default=None, description="the harness as it was designed, to compare with"
    )
    files: list[Literal["overlay", "mask"]] = Field(
        default=["overlay"], max_length=2, description="to make beside the result"
    )
