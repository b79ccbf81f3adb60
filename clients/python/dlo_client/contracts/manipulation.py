"""Kinds of thesis chapter 5: where to grasp a DLO and where to place it, and what it is made of.

Lengths are meters on the table, in one right-handed frame that the client chooses; angles are
radians, counted from x to y. Points of a DLO are ordered from one end to the other; edge k joins
points k and k + 1.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from dlo_client.contracts.base import Contract, Numbers, Taken
from dlo_client.contracts.fixtures import Fixture, Route, check_fixtures, check_reach, check_route
from dlo_client.contracts.foreground import ForegroundOptions
from dlo_client.contracts.images import ImageSource
from dlo_client.contracts.on_table import LEAST_LENGTH_M, LONGEST_M, Point2
from dlo_client.contracts.shape_plans import Friction, PlannedAction, PlanShapeResult, PlanWarning
from dlo_client.contracts.submission import JobRequest, ModelUsed

_Entry = Annotated[float, Field(ge=-1e12, le=1e12)]
Row3 = tuple[_Entry, _Entry, _Entry]

MOST_STRETCH = 5.0
"""What is stated about one DLO's length does not differ by more than this factor."""


def length_of(points: list[Point2]) -> float:
    """Meters from end to end along a DLO."""
    return sum(math.dist(a, b) for a, b in pairwise(points))


def in_another_unit(length_m: float) -> str:
    """The unit that a length may be in which no DLO on a table has in meters."""
    return "millimeters" if length_m > 5 * LONGEST_M else "centimeters"


def _is_a_line(points: list[Point2]) -> list[Point2]:
    length = length_of(points)
    if length < LEAST_LENGTH_M:
        raise ValueError("the points all lie at one place: a DLO is longer than 1 mm")
    if length > LONGEST_M:
        unit = in_another_unit(length)
        raise ValueError(
            f"is {length:.4g} m long, a DLO on a table at most {LONGEST_M:g} m: are these {unit}?"
        )
    return points


Shape = Annotated[
    list[Point2], Field(min_length=2, max_length=2000), AfterValidator(_is_a_line), Numbers
]
"""A DLO on the table, end to end; any number of points."""


def _check_length(name: str, length_m: float, other_m: float) -> None:
    """Raises ValueError for the length of another DLO than the one that is ``other_m`` long, or in
    another unit."""
    ratio = length_m / other_m
    if not 1 / MOST_STRETCH <= ratio <= MOST_STRETCH:
        text = f"{ratio:.3g} times as long as the DLO is elsewhere in the request: is one of both in another unit?"
        raise ValueError(f"`{name}` is {length_m:.4g} m long, {text}")


class DloObject(Contract):
    """What is known of the DLO: its mass, and its length if it is not to be taken from its
    state."""

    mass_kg: float = Field(gt=0, le=10, description="of the whole DLO")
    length_m: float | None = Field(
        default=None, ge=LEAST_LENGTH_M, le=LONGEST_M, description="default: that of its state"
    )
    diameter_m: float | None = Field(
        default=None,
        gt=0,
        le=0.2,
        description="meters, for contact with `fixtures`; default a hundredth of its length",
    )


_Shift = Annotated[float, Field(ge=-LONGEST_M, le=LONGEST_M)]


class MoveAction(Taken):
    """Grip the middle of an edge, move it by dx, dy, turn it about its middle by dtheta, let go. An
    action that ``plan_shape`` answered fits."""

    edge: int = Field(ge=0, lt=2000, description="joins points `edge` and `edge` + 1 of the DLO")
    dx_m: _Shift = Field(description="of the edge's middle")
    dy_m: _Shift = Field(description="of the edge's middle")
    dtheta_rad: float = Field(
        ge=-3.15, le=3.15, description="turn of the edge about its middle, from x to y"
    )


class Experience(Contract):
    """An action and what it did; ``edge`` counts along ``before``."""

    before: Shape = Field(description="the DLO before the action, end to end, meters")
    action: MoveAction = Field(description="what was done")
    after: Shape = Field(description="the DLO after the action, the same end first, meters")

    @model_validator(mode="after")
    def _one_dlo(self) -> Experience:
        _check_length("after", length_of(self.after), length_of(self.before))
        return self


class RopeParameters(Taken):
    """Bending k_b (N m/rad a joint) and damping k_d (N s/m a node) of the model of 16 nodes (eq.
    5.1 to 5.3).

    Those that ``plan_shape`` used or ``estimate_parameters`` found fit.
    """

    k_b: float = Field(gt=0, le=100, description="bending, N m/rad a joint")
    k_d: float = Field(gt=0, le=1000, description="damping, N s/m a node")


class PlanLimits(Contract):
    """What an action has to keep to; what is left out does not bind."""

    workspace_m: tuple[Point2, Point2] | None = Field(
        default=None, description="lowest and highest x, y for all"
    )
    keep_out_m: list[Annotated[list[Point2], Field(min_length=3, max_length=64)]] = Field(
        default_factory=list,
        max_length=32,
        description="polygons that neither gripper nor DLO may enter",
    )
    base_xy_m: Point2 | None = Field(default=None, description="foot of the robot, for its reach")
    reach_m: tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(gt=0)]] | None = Field(
        default=None, description="least and largest distance of pick and place to the base"
    )
    max_displacement_m: float | None = Field(
        default=None,
        gt=0,
        le=LONGEST_M,
        description="along x and along y; default and at most 0.1 for DLOs of 0.15 to 0.5 m. For a shorter one in "
        "proportion less; for a longer one more may be asked for, in proportion",
    )
    max_rotation_rad: float | None = Field(
        default=None, ge=0, le=7, description="default and at most 0.785"
    )
    no_grasp_edges: list[Annotated[int, Field(ge=0, lt=2000)]] = Field(
        default_factory=list,
        max_length=2000,
        description="edges of the state that may not be gripped, from 0",
    )

    @model_validator(mode="after")
    def _consistent(self) -> PlanLimits:
        if self.workspace_m and any(a >= b for a, b in zip(*self.workspace_m, strict=True)):
            raise ValueError("`workspace_m`: the first corner is the lower one in x and in y")
        if (self.base_xy_m is None) != (self.reach_m is None):
            raise ValueError("`reach_m` and base_xy_m belong together")
        if self.reach_m and self.reach_m[0] >= self.reach_m[1]:
            raise ValueError("`reach_m`: the least distance comes first")
        return self


class PlanGripper(Contract):
    """The room that a gripper takes."""

    width_m: float = Field(
        ge=0, le=1, description="meters, of a circle about the place that it grips"
    )


class PlanShapeRequest(ForegroundOptions, JobRequest[PlanShapeResult]):
    """State and target to the pick-and-place that brings the DLO closest to the target.

    The state is given as points, or as a picture of the table with the homography that takes its
    pixels to the table; then the service finds the DLO, and the target decides which of its ends is
    which.
    """

    kind: Literal["plan_shape"] = Field(default="plan_shape", description="of the job")
    state_m: Shape | None = Field(
        default=None,
        description="the DLO as it is now, end to end, meters on the table; or an `image`",
    )
    image: ImageSource | None = Field(
        default=None, description="instead of state_m; or an `image` part"
    )
    homography: Annotated[tuple[Row3, Row3, Row3] | None, Numbers] = Field(
        default=None,
        description="3 × 3, row by row: (x, y, 1) px to (X, Y, W), the table is (X, Y) / W in meters",
    )
    target_m: Shape | None = Field(
        default=None, description="the DLO as it should be, the same end first; or a `route`"
    )
    fixtures: list[Fixture] = Field(
        default_factory=list,
        max_length=32,
        description="pegs, clips and edges that stand on the table",
    )
    route: Route | None = Field(
        default=None,
        description="instead of target_m: around which pegs and through which clips the DLO should go",
    )
    gripper: PlanGripper | None = Field(
        default=None,
        description="its room is kept out of `limits.keep_out_m` and `fixtures`; default: none",
    )
    object: DloObject = Field(description="what is known of the DLO")
    parameters: RopeParameters | None = Field(
        default=None, description="default: estimated from the history"
    )
    history: list[Experience] = Field(
        default_factory=list,
        max_length=100,
        description="actions so far and what they did: the DLO is learnt from them",
    )
    tried: int = Field(
        default=0,
        ge=0,
        le=100,
        description="how many of the last items of `history` aimed at this target: `stuck` where they brought nothing",
    )
    horizon: int = Field(
        default=2,
        ge=1,
        le=4,
        description="how many actions are looked ahead, where one alone brings little",
    )
    limits: PlanLimits = Field(
        default_factory=PlanLimits, description="what the robot and the table allow"
    )
    tolerance_m: float = Field(
        default=0.01, gt=0, le=1, description="mean distance at which the target is reached"
    )
    scale_target: bool = Field(
        default=False, description="give the target the state's length, about its middle"
    )
    alternatives: int = Field(
        default=3, ge=0, le=14, description="how many further actions to list"
    )
    valid_for_s: float = Field(
        default=10.0, gt=0, le=3600, description="how long the DLO stays as it was seen"
    )

    @property
    def needs_picture(self) -> bool:
        return self.state_m is None

    @model_validator(mode="after")
    def _one_state(self) -> PlanShapeRequest:
        if self.state_m is not None and (self.image is not None or self.homography is not None):
            raise ValueError("`state_m` and a picture exclude each other")
        if (self.target_m is None) == (self.route is None):
            raise ValueError("`target_m` or a route is needed, not both")
        if self.state_m is None and self.homography is None:
            raise ValueError("`state_m` is missing; or give an image and its homography")
        given = self.of_a_network or ("regions" if self.regions else None)
        if self.state_m is not None and given:
            raise ValueError(f"`{given}` has no meaning beside state_m: there is no picture")
        return self

    @model_validator(mode="after")
    def _one_unit(self) -> PlanShapeRequest:
        """Checked where a length is known without the picture."""
        length = self.object.length_m or (length_of(self.state_m) if self.state_m else None)
        if length is not None and self.state_m is not None:
            _check_length("state_m", length_of(self.state_m), length)
        if length is not None and self.target_m is not None and not self.scale_target:
            _check_length("target_m", length_of(self.target_m), length)
        length = length or (length_of(self.target_m) if self.target_m else None)
        for item in self.history:
            _check_length(
                "history", length_of(item.before), length or length_of(self.history[0].before)
            )
        return self

    @model_validator(mode="after")
    def _possible(self) -> PlanShapeRequest:
        check_fixtures(self.fixtures, self.object.diameter_m or 0.0)
        if self.route is None:
            return self
        if self.scale_target:
            raise ValueError("`scale_target` has no meaning beside a route")
        if self.state_m is None and self.route.start_m is None:
            raise ValueError(
                "`route.start_m` is needed with a picture: it decides which end of the DLO is which"
            )
        check_route(self.route, self.fixtures)
        limits = self.limits
        base = (limits.base_xy_m, limits.reach_m) if limits.base_xy_m and limits.reach_m else None
        check_reach(self.route, self.fixtures, limits.workspace_m, base)
        return self


class EstimateParametersResult(Friction):
    kind: Literal["estimate_parameters"] = Field(
        default="estimate_parameters", description="kind of the job"
    )
    k_b: float = Field(description="bending, N m/rad a joint, as `plan_shape` takes it")
    k_d: float = Field(description="damping, N s/m a node, as `plan_shape` takes it")
    sigma: tuple[float, float] = Field(
        description="standard deviations of the natural logarithms of k_b and k_d"
    )
    ratio_sigma: float = Field(
        description="the same of the logarithm of k_b / k_d, which is what slow motions show"
    )
    loss_m: float = Field(description="mean distance of a point that is left with these parameters")
    loss_mid_range_m: float = Field(description="the same with the middle of the trained range")
    sample_errors_m: list[float] = Field(description="one for each item of the history")
    warnings: list[PlanWarning] = Field(description="what limits the estimate")
    models: list[ModelUsed] = Field(description="networks that took part")


class EstimateParametersRequest(JobRequest[EstimateParametersResult]):
    """Actions and what they did to the parameters that explain it best (eq. 5.10)."""

    kind: Literal["estimate_parameters"] = Field(
        default="estimate_parameters", description="of the job"
    )
    history: list[Experience] = Field(
        min_length=1, max_length=100, description="actions and what they did"
    )
    object: DloObject = Field(description="what is known of the DLO")

    @model_validator(mode="after")
    def _one_unit(self) -> EstimateParametersRequest:
        length = self.object.length_m or length_of(self.history[0].before)
        for item in self.history:
            _check_length("history", length_of(item.before), length)
        return self


PlannedAction.model_rebuild()
