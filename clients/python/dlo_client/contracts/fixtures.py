"""What stands on the table beside a DLO, and the route that the DLO should take along it.

A DLO is dragged on the table, not lifted over pegs and edges. It gets into a clip from above, where
a gripper presses it in, and is held there across the clip's direction; it may slide along it.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract
from dlo_client.contracts.on_table import LEAST_LENGTH_M, Point2

_Size = Annotated[float, Field(ge=1e-4, le=1.0)]


class Peg(Contract):
    """A round post that a DLO cannot pass through."""

    kind: Literal["peg"] = Field(description="of the fixture")
    xy_m: Point2 = Field(description="its middle, meters on the table")
    radius_m: _Size = Field(description="of the post, meters")


class Clip(Contract):
    """Two walls that hold a DLO between them."""

    kind: Literal["clip"] = Field(description="of the fixture")
    xy_m: Point2 = Field(description="the middle between its walls, meters on the table")
    angle_rad: float = Field(
        ge=-7, le=7, description="direction of a DLO in it, either way, counted from x to y"
    )
    width_m: _Size = Field(description="between its walls, meters; more than the DLO's diameter")
    length_m: _Size = Field(default=0.02, description="of its walls, meters along the DLO")


class TableEdge(Contract):
    """A thin wall that a DLO cannot cross."""

    kind: Literal["edge"] = Field(description="of the fixture")
    from_m: Point2 = Field(description="one end, meters on the table")
    to_m: Point2 = Field(description="the other end, meters on the table")

    @model_validator(mode="after")
    def _has_length(self) -> TableEdge:
        if math.dist(self.from_m, self.to_m) < LEAST_LENGTH_M:
            raise ValueError("`to_m` is where the edge begins: an edge is longer than 1 mm")
        return self


Fixture = Annotated[Peg | Clip | TableEdge, Field(discriminator="kind")]


class RouteStop(Contract):
    """A fixture that the DLO passes."""

    fixture: int = Field(ge=0, lt=32, description="index in `fixtures`: a peg or a clip")
    side: Literal["left", "right"] | None = Field(
        default=None,
        description="where a peg is, seen along the DLO from its first point; none for a clip",
    )


class Route(Contract):
    """The DLO passes the stops in this order, from its first point on."""

    stops: list[RouteStop] = Field(
        min_length=1, max_length=16, description="in order along the DLO"
    )
    slack_m: float = Field(
        default=0.02, ge=1e-3, le=0.5, description="largest gap between the DLO and a peg, meters"
    )
    start_m: Point2 | None = Field(
        default=None,
        description="wished place of the DLO's first point, meters; default: where it is",
    )
    end_m: Point2 | None = Field(
        default=None,
        description="towards which the DLO goes behind the last stop, meters; default: straight on",
    )


def check_fixtures(fixtures: list[Peg | Clip | TableEdge], diameter_m: float) -> None:
    """Raises ValueError naming the fixture that cannot be there with those before it."""
    for k, here in enumerate(fixtures):
        if isinstance(here, Clip) and here.width_m <= diameter_m:
            text = (
                f"is {here.width_m:g} m, the DLO's diameter {diameter_m:g} m (`object.diameter_m`)"
            )
            raise ValueError(f"`fixtures.{k}.width_m` {text}")
        if not isinstance(here, Peg):
            continue
        for j, other in enumerate(fixtures[:k]):
            if (
                isinstance(other, Peg)
                and math.dist(here.xy_m, other.xy_m) < here.radius_m + other.radius_m
            ):
                raise ValueError(
                    f"`fixtures.{k}` is inside fixtures.{j}: pegs stand beside each other"
                )
            if isinstance(other, Clip) and math.dist(here.xy_m, other.xy_m) < here.radius_m:
                raise ValueError(f"`fixtures.{k}` is on fixtures.{j}: no DLO gets into that clip")


def check_route(route: Route, fixtures: list[Peg | Clip | TableEdge]) -> None:
    """Raises ValueError naming the stop that is none."""
    for k, stop in enumerate(route.stops):
        name = f"`route.stops.{k}"
        if stop.fixture >= len(fixtures):
            raise ValueError(
                f"{name}.fixture` is {stop.fixture}, there are {len(fixtures)} fixtures, from 0"
            )
        if stop.fixture in [s.fixture for s in route.stops[:k]]:
            raise ValueError(f"{name}.fixture` is in the route before: a DLO passes a fixture once")
        fixture = fixtures[stop.fixture]
        if isinstance(fixture, TableEdge):
            raise ValueError(
                f"{name}.fixture` is an edge: a route goes around pegs and through clips"
            )
        if isinstance(fixture, Peg) == (stop.side is None):
            raise ValueError(f"{name}.side` is needed for a peg, and has no meaning for a clip")


def check_reach(
    route: Route,
    fixtures: list[Peg | Clip | TableEdge],
    workspace_m: tuple[Point2, Point2] | None,
    base: tuple[Point2, tuple[float, float]] | None,
) -> None:
    """Raises ValueError naming a fixture of the route that is out of the workspace, or a clip that
    is out of reach."""
    for stop in route.stops:
        fixture = fixtures[stop.fixture]
        if isinstance(fixture, TableEdge):
            continue
        name, xy = f"`fixtures.{stop.fixture}`", fixture.xy_m
        if workspace_m and any(
            not a <= v <= b for a, v, b in zip(workspace_m[0], xy, workspace_m[1], strict=True)
        ):
            raise ValueError(f"{name} is outside limits.workspace_m")
        if (
            base
            and isinstance(fixture, Clip)
            and not base[1][0] <= math.dist(base[0], xy) <= base[1][1]
        ):
            away = math.dist(base[0], xy)
            raise ValueError(
                f"{name}: the clip is {away:.3g} m from limits.base_xy_m, out of limits.reach_m"
            )
