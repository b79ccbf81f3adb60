"""A robot that is not there: a rope on a rough table, for trying the shape controller without a
cell.

It is another model than the one the service has learnt: nothing moves unless it is pulled (friction
holds it), edges keep their length, and stiffness straightens the rope near what moves. Positions
are corrected edge by edge, many times a small step of the gripper (position based dynamics).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from dlo_client.contracts import PlannedAction

Point = list[float]

_STEP_M = 0.004
_SWEEPS = 40


class SimulatedTable:
    """A rope of ``length_m`` that is straight along x; ``stiffness`` 0 (a chain) to 1 (a rod)."""

    def __init__(self, length_m: float = 0.45, points: int = 16, stiffness: float = 0.3) -> None:
        self._edge = length_m / (points - 1)
        self._stiffness = stiffness
        self._points: list[Point] = [
            [(k - (points - 1) / 2) * self._edge, 0.0] for k in range(points)
        ]
        self.frames: list[list[tuple[float, float]]] = [self.observe()]
        """The rope after every small step of the gripper, for an animation."""

    def observe(self) -> list[tuple[float, float]]:
        return [(x, y) for x, y in self._points]

    def execute(self, action: PlannedAction) -> None:
        """Drag the edge along a straight way while it turns."""
        held = (action.edge, action.edge + 1)
        start = [list(self._points[k]) for k in held]
        cx, cy = ((start[0][i] + start[1][i]) / 2 for i in (0, 1))
        reach = math.hypot(action.dx_m, action.dy_m) + abs(action.dtheta_rad) * self._edge
        steps = max(1, math.ceil(reach / _STEP_M))
        for n in range(1, steps + 1):
            share = n / steps
            cos, sin = math.cos(share * action.dtheta_rad), math.sin(share * action.dtheta_rad)
            for k, (x, y) in zip(held, start, strict=True):
                ax, ay = x - cx, y - cy
                self._points[k] = [
                    cx + cos * ax - sin * ay + share * action.dx_m,
                    cy + sin * ax + cos * ay + share * action.dy_m,
                ]
            self._settle(held)
            self.frames.append(self.observe())

    def _settle(self, held: tuple[int, int]) -> None:
        count = len(self._points)
        for _ in range(_SWEEPS):
            for k in range(count - 1):
                self._keep(k, k + 1, self._edge, 1.0, held)
            for k in range(count - 2):
                self._keep(k, k + 2, 2 * self._edge, 0.02 * self._stiffness, held)

    def _keep(self, a: int, b: int, length: float, share: float, held: tuple[int, int]) -> None:
        """Move two points towards their distance ``length``; what is held does not give way."""
        weight_a, weight_b = float(a not in held), float(b not in held)
        if weight_a + weight_b == 0:
            return
        (ax, ay), (bx, by) = self._points[a], self._points[b]
        dx, dy = bx - ax, by - ay
        distance = math.hypot(dx, dy) or 1e-12
        pull = share * (distance - length) / distance / (weight_a + weight_b)
        self._points[a] = [ax + weight_a * pull * dx, ay + weight_a * pull * dy]
        self._points[b] = [bx - weight_b * pull * dx, by - weight_b * pull * dy]


def target_shape(name: str, length_m: float = 0.45, points: int = 16) -> list[tuple[float, float]]:
    """The thesis's targets (5.7.2): ``U``, ``A`` (bent more in its middle), ``S``, or ``I``
    (straight, turned by 90°).

    Raises ValueError for another name.
    """
    if name not in TARGETS:
        raise ValueError(f"no target {name!r}; there are {', '.join(TARGETS)}")
    edge = length_m / (points - 1)
    xs, ys = [0.0], [0.0]
    for k in range(points - 1):
        heading = TARGETS[name]((k + 0.5) / (points - 1))
        xs.append(xs[-1] + edge * math.cos(heading))
        ys.append(ys[-1] + edge * math.sin(heading))
    mx, my = sum(xs) / points, sum(ys) / points
    return [(x - mx, y - my) for x, y in zip(xs, ys, strict=True)]


def _bend(sharpness: float) -> Callable[[float], float]:
    return lambda t: 1.35 * math.tanh(sharpness * (t - 0.5)) / math.tanh(sharpness / 2)


TARGETS: dict[str, Callable[[float], float]] = {
    "U": lambda t: 1.5 * (2 * t - 1),
    "A": _bend(9.0),
    "S": lambda t: 1.2 * math.cos(2 * math.pi * t),
    "I": lambda t: math.pi / 2,
}
"""Heading of the rope over the share of its length."""


def extent(shapes: Sequence[Sequence[tuple[float, float]]]) -> tuple[float, float, float, float]:
    """Least and largest x and y of all points."""
    xs = [x for shape in shapes for x, _ in shape]
    ys = [y for shape in shapes for _, y in shape]
    return min(xs), min(ys), max(xs), max(ys)
