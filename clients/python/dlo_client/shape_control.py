"""Bring a DLO into a shape with a robot: thesis Algorithm 5 around anything that can look and pick
and place.

    controller = ShapeController(client, robot, DloObject(mass_kg=0.05), target_m)
    outcome = controller.run()

After every action the service is told what it did, and knows the DLO better for the next.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from dlo_client.calls import blocking
from dlo_client.client import Client
from dlo_client.contracts import (
    DloObject,
    Experience,
    MoveAction,
    PlanLimits,
    PlannedAction,
    PlanShapeRequest,
    PlanShapeResult,
)
from dlo_client.contracts.fixtures import Fixture, Route
from dlo_client.contracts.shape_plans import UsedParameters
from dlo_client.errors import InvalidArgument

Points = Sequence[tuple[float, float]]


class Robot(Protocol):
    """A cell with a camera and a gripper. Points are meters on the table, from one end of the DLO
    to the other; the same end comes first every time."""

    def observe(self) -> Points:
        """The DLO as it is now."""

    def execute(self, action: PlannedAction) -> None:
        """Grip at ``action.pick``, move to ``action.place``, let go."""


@dataclass(frozen=True)
class Step:
    """One turn of the loop: what was seen, planned and reached; errors are mean distances in
    meters."""

    before: Points
    plan: PlanShapeResult
    after: Points
    error_m: float
    """Of ``after``; NaN if it has another number of points than the target, or on a route."""


@dataclass(frozen=True)
class ShapeOutcome:
    """``reached`` within the threshold; ``reason`` of the last plan; errors before the first action
    and after each."""

    reached: bool
    reason: str
    errors_m: list[float]
    steps: list[Step]
    parameters: list[UsedParameters]


@dataclass
class ShapeController:
    """``threshold_m`` is the thesis's epsilon; ``remembered`` actions at most are told to the
    service."""

    client: Client
    robot: Robot
    object: DloObject
    target_m: Points | None
    """None where there is a ``route``."""
    threshold_m: float = 0.01
    max_actions: int = 10
    horizon: int = 2
    limits: PlanLimits = field(default_factory=PlanLimits)
    fixtures: list[Fixture] = field(default_factory=list)
    route: Route | None = None
    remembered: int = 20
    learn: bool = True
    """False plans with the middle of the parameters' range all the time."""
    history: list[Experience] = field(default_factory=list)
    _tried: int = field(default=0, init=False)
    """Actions of the history that aimed at this target."""

    def __post_init__(self) -> None:
        blocking(self.client, type(self).__name__)
        if self.target_m is None and self.route is None:
            raise InvalidArgument("target_m", "takes (x, y) pairs in meters; or give a route")
        if self.target_m is not None:
            self.target_m = _points(self.target_m, "target_m")

    def run(self) -> ShapeOutcome:
        """Act until the target is reached, no action helps, or ``max_actions`` are done."""
        steps = list(self.steps())
        last = self.plan(self._seen())
        errors = [*(s.plan.error_before_m for s in steps), last.error_before_m]
        parameters = [*(s.plan.parameters for s in steps), last.parameters]
        return ShapeOutcome(last.converged, last.status.message, errors, steps, parameters)

    def steps(self) -> Iterator[Step]:
        """The loop, a step at a time, for callers that want to look on."""
        before = self._seen()
        for _ in range(self.max_actions):
            plan = self.plan(before)
            if plan.action is None:
                return
            self.robot.execute(plan.action)
            after = self._seen()
            self._remember(before, plan.action, after)
            yield Step(before, plan, after, mean_distance(after, self.target_m or ()))
            before = after

    def plan(self, state_m: Points) -> PlanShapeResult:
        """What to do next, from this state and all that is remembered."""
        request = PlanShapeRequest(
            state_m=_points(state_m, "state_m"),
            target_m=None if self.target_m is None else list(self.target_m),
            fixtures=self.fixtures,
            route=self.route,
            object=self.object,
            history=self.history[-self.remembered :] if self.learn else [],
            tried=min(self._tried, self.remembered) if self.learn else 0,
            horizon=self.horizon,
            limits=self.limits,
            tolerance_m=self.threshold_m,
        )
        return self.client.run(request)

    def _seen(self) -> list[tuple[float, float]]:
        return _points(self.robot.observe(), "robot.observe()")

    def _remember(self, before: Points, action: PlannedAction, after: Points) -> None:
        done = MoveAction(
            edge=action.edge, dx_m=action.dx_m, dy_m=action.dy_m, dtheta_rad=action.dtheta_rad
        )
        self.history.append(Experience(before=list(before), action=done, after=list(after)))
        self._tried += 1


def _points(given: Iterable[Iterable[float]], argument: str) -> list[tuple[float, float]]:
    """Pairs of numbers, from lists, tuples or an (N, 2) array. Raises InvalidArgument."""
    try:
        return [(float(x), float(y)) for x, y in given]
    except (TypeError, ValueError) as error:
        raise InvalidArgument(argument, f"takes (x, y) pairs in meters: {error}") from error


def mean_distance(points: Points, others: Points) -> float:
    """Between corresponding points; NaN when there are not equally many."""
    if len(points) != len(others):
        return float("nan")
    pairs = zip(points, others, strict=True)
    return sum(math.hypot(ax - bx, ay - by) for (ax, ay), (bx, by) in pairs) / len(points)
