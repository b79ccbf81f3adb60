"""The answer to a request for the next action on a DLO."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dlo_client.contracts.base import Reply
from dlo_client.contracts.foreground import ReferencesUsed
from dlo_client.contracts.submission import ModelUsed


class GripPose(Reply):
    """Where the gripper goes: the middle of the edge, and the direction of the edge."""

    xy_m: tuple[float, float] = Field(description="between the fingers, meters on the table")
    angle_rad: float = Field(description="of the edge that is gripped; the fingers close across it")


class PlannedAction(Reply):
    """An action that the service proposes."""

    edge: int = Field(description="counted along `state_m`")
    dx_m: float = Field(description="of the gripped edge's middle")
    dy_m: float = Field(description="of the gripped edge's middle")
    dtheta_rad: float = Field(description="turn of the edge about its middle, from x to y")
    pick: GripPose = Field(description="where to grip")
    place: GripPose = Field(description="where to let go")
    error_after_m: float = Field(
        description="expected mean distance of corresponding points to the target, over all models that may be right"
    )
    error_at_end_m: float = Field(description="the same after the whole horizon")
    converged: bool = Field(description="the optimizer came to rest")
    probability: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="probability that it brings at least half of what is expected; null among `fixtures`",
    )
    checks: list[PlanCheck] = Field(description="every limit and whether it is kept")


class PlanCheck(Reply):
    """A limit that was checked; a proposed action has passed them all."""

    name: Literal[
        "displacement", "rotation", "workspace", "reach", "keep_out", "grasp", "fixtures"
    ] = Field(description="of the limit")
    passed: bool = Field(description="whether the action keeps it")


PlanCode = Literal["ok", "done", "stuck", "no_action", "target_outside"]


StuckReason = Literal["springs_back", "unlike_any_model", "limits", "local_optimum"]


class PlanStatus(Reply):
    """``ok``: there is an action. ``done``: the state is the target already. ``stuck``: no sequence
    of actions is expected to bring the DLO nearer, or those of the history brought nothing;
    `reason` is the probable one. ``no_action``: every action breaks a limit. ``target_outside``:
    the target itself breaks one.

    Reasons: ``springs_back``: friction does not hold the DLO in the target's shape.
    ``unlike_any_model``: the DLO does not move as any known model. ``limits``: what would help
    breaks a limit. ``local_optimum``: none of these.
    """

    code: PlanCode = Field(description="for programs")
    message: str = Field(description="the code in words")
    reason: StuckReason | None = Field(
        default=None, description="why the plan is `stuck`; else null"
    )


class PlanWarning(Reply):
    """Something that makes the answer less sure; ``field`` is what it is about."""

    code: Literal[
        "mass_untrained",
        "length_untrained",
        "lengths_differ",
        "self_crossing",
        "history_contradicts",
        "parameters_untrained",
        "limits_reduced",
        "other_dlo",
        "picture",
        "springs_back",
        "unlike_any_model",
    ] = Field(description="for programs")
    field: str = Field(description="of the request, that it is about")
    message: str = Field(description="the code in words")


class Friction(Reply):
    """What holds the DLO on the table, and with dry friction how stiff it is over that."""

    friction: Literal["viscous", "dry"] = Field(
        default="viscous", description="of the table, the more probable kind"
    )
    friction_probability: float = Field(
        default=1.0, ge=0, le=1, description="probability of that kind, 0 to 1"
    )
    stiffness_m: float | None = Field(
        default=None,
        description="with dry friction: bending moment of a joint a rad over the friction force of a node, of 16",
    )


class UsedParameters(Friction):
    """``k_b`` and ``k_d`` that were planned with, and where they come from; ``sigma`` are the
    standard deviations of their natural logarithms. Slow motions show the ratio k_b / k_d far
    better than either.

    ``dry`` friction is planned with where it explains the history better than the network's viscous
    friction.
    """

    k_b: float = Field(description="bending, N m/rad a joint")
    k_d: float = Field(description="damping, N s/m a node")
    sigma: tuple[float, float] | None = Field(
        default=None, description="standard deviations of the natural logarithms of k_b and k_d"
    )
    source: Literal["request", "history", "mid_range"] = Field(
        description="where the parameters come from"
    )


class PlanShapeResult(Reply):
    kind: Literal["plan_shape"] = Field(default="plan_shape", description="kind of the job")
    status: PlanStatus = Field(description="what was planned, or why nothing was")
    action: PlannedAction | None = Field(description="the best action; null when none helps")
    alternatives: list[PlannedAction] = Field(description="other edges, best first")
    state_m: list[tuple[float, float]] = Field(
        description="as given, or as seen in the picture, in the target's order"
    )
    target_m: list[tuple[float, float]] = Field(
        default_factory=list, description="the shape that is aimed at: as given, or of the route"
    )
    predicted_m: list[tuple[float, float]] | None = Field(description="the DLO after `action`")
    error_before_m: float = Field(
        description="mean distance of the state to the target; among `fixtures` the mean way around them"
    )
    error_after_m: float | None = Field(description="the same after the planned actions")
    converged: bool = Field(
        description="the state is within the tolerance of the target, or on the route"
    )
    stops_left: list[int] = Field(
        default_factory=list,
        description="indices of the route's stops at which the state is not as it should be",
    )
    parameters: UsedParameters = Field(description="what the DLO was taken to be made of")
    valid_for_s: float = Field(description="counted from the job's `ended_at`; then look again")
    reference: ReferencesUsed = Field(default_factory=list)
    warnings: list[PlanWarning] = Field(description="what limits the plan")
    models: list[ModelUsed] = Field(description="networks that took part")
