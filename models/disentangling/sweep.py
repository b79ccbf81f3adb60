"""What a piece crosses as it turns about the place held (thesis Algorithm 7)."""

from __future__ import annotations

import numpy as np

from models.disentangling.hands import allowance
from models.disentangling.rigid_piece import Body, turned
from models.geometry.arrays import FloatArray
from models.geometry.polylines import paired_intersections, segments
from models.topology.scene import Topology

_ROUNDED = 1e-9
_HELD = 1 / 3
"""Hands beyond three quarters of a width within which strands touch where one is held: that is no
crossing."""


class Sweep:
    """A body to be turned.

    Strategy: a turn changes no point's distance to the center, so of all pairs of a moving and a
    resting segment only those whose ranges of distances overlap can ever cross. They are found
    once, for all angles.
    """

    def __init__(self, topology: Topology, body: Body) -> None:
        self._center = body.center
        starts, ends, moving = segments(body.moving)
        rest_starts, rest_ends, resting = segments(body.resting)
        least, most = _reach(starts, ends, body.center)
        rest_least, rest_most = _reach(rest_starts, rest_ends, body.center)
        i, j = np.nonzero((least[:, None] <= rest_most) & (rest_least <= most[:, None]))
        self._moved, self._rest = (starts[i], ends[i]), (rest_starts[j], rest_ends[j])
        self._moving, self._resting = moving[i].astype(int), resting[j].astype(int)
        widths = np.array([s.width for s in topology.sections])
        self._apart = allowance(widths[self._resting], 0.75, _HELD)

    @property
    def pairs(self) -> int:
        """Pairs of segments that are looked at for each angle."""
        return len(self._moving)

    def crossings(self, angle: float) -> list[tuple[int, int, FloatArray]]:
        """``(moving, resting)`` sections of every crossing between the body at an angle (radians)
        and the rest, and where ``(2,)``; not right at the place held."""
        start, end = (turned(xy, self._center, angle) for xy in self._moved)
        met, xy = paired_intersections((start, end), self._rest)
        clear = np.flatnonzero(np.hypot(*(xy - self._center).T) > self._apart[met])
        return [(int(self._moving[met[k]]), int(self._resting[met[k]]), xy[k]) for k in clear]

    def passed_over(self, turn: float) -> tuple[int, ...]:
        """Sections that the body passes over on its way without lying on them before or after."""
        steps = np.linspace(0, turn, max(3, int(abs(np.rad2deg(turn)) // 10) + 2)).tolist()
        on_the_way = {rest for a in steps[1:-1] for _, rest, _ in self.crossings(a)}
        at_ends = {rest for a in (0.0, turn) for _, rest, _ in self.crossings(a)}
        return tuple(sorted(on_the_way - at_ends))


def _reach(
    starts: FloatArray, ends: FloatArray, center: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least and largest distance ``(S,)`` of every segment to a place."""
    start, end = starts - center, ends - center
    along = end - start
    share = np.clip(-(start * along).sum(1) / np.maximum((along**2).sum(1), 1e-18), 0, 1)
    nearest = np.hypot(*(start + share[:, None] * along).T)
    return nearest - _ROUNDED, np.maximum(np.hypot(*start.T), np.hypot(*end.T)) + _ROUNDED
