"""What a piece crosses as it turns about the place held (thesis Algorithm 7)."""

from __future__ import annotations

import numpy as np

from models.disentangling.hands import allowance
from models.disentangling.rigid_piece import Body, turned
from models.geometry.arrays import FloatArray
from models.geometry.polylines import intersections, segments
from models.topology.scene import Topology

_HELD = 1 / 3
"""Hands beyond three quarters of a width within which strands touch where one is held: that is no crossing."""


class Sweep:
    """A body to be turned; what rests out of its reach is left out at once."""

    def __init__(self, topology: Topology, body: Body) -> None:
        self._center = body.center
        self._starts, self._ends, self._moving = segments(body.moving)
        starts, ends, resting = segments(body.resting)
        reach = float(np.hypot(*(np.concatenate((self._starts, self._ends)) - body.center).T).max(initial=0.0))
        nearest = np.hypot(*((starts + ends) / 2 - body.center).T) - np.hypot(*(ends - starts).T) / 2
        near = nearest <= reach
        self._rest = (starts[near], ends[near])
        self._resting = resting[near].astype(int)
        widths = np.array([s.width for s in topology.sections])
        self._apart = allowance(widths[self._resting], 0.75, _HELD)

    def crossings(self, angle: float) -> list[tuple[int, int, FloatArray]]:
        """``(moving, resting)`` sections of every crossing between the body at an angle (radians) and the rest, and
        where ``(2,)``; not right at the place held."""
        moved = tuple(turned(xy, self._center, angle) for xy in (self._starts, self._ends))
        i, j, xy = intersections((moved[0], moved[1]), self._rest)
        clear = np.flatnonzero(np.hypot(*(xy - self._center).T) > self._apart[j])
        return [(int(self._moving[i[k]]), int(self._resting[j[k]]), xy[k]) for k in clear]

    def passed_over(self, turn: float) -> tuple[int, ...]:
        """Sections that the body passes over on its way without lying on them before or after."""
        steps = np.linspace(0, turn, max(3, int(abs(np.rad2deg(turn)) // 10) + 2)).tolist()
        on_the_way = {rest for a in steps[1:-1] for _, rest, _ in self.crossings(a)}
        at_ends = {rest for a in (0.0, turn) for _, rest, _ in self.crossings(a)}
        return tuple(sorted(on_the_way - at_ends))
