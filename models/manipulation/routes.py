"""Routes: a DLO around pegs and through clips, in order, and the shape that it has on one.

Strategy: from its first point the DLO goes straight to where it touches the first fixture, around a
peg on an arc, through a clip along its direction, and so on; behind the last fixture straight on. A
peg that the straight way does not bend around is passed at a point. The distance kept from pegs is
a third of the slack, so that what an action misses stays within it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.geometry.polylines import arc_lengths, point_at
from models.manipulation.fixtures import Clip, in_clips
from models.manipulation.frames import FloatArray

_KEPT = 1 / 3
"""Share of the slack that the shape keeps from a peg."""
_ARC_RAD = 0.1
_MOST_AROUND = 1.5 * np.pi
"""A peg that the DLO would have to wind around by more is on the outer side of a bend the other
way."""


class Impossible(ValueError):
    """A route that no DLO can take: ``stop`` is the index of the stop that is at fault, or
    ``needed`` the length in m that it has."""

    def __init__(self, text: str, stop: int | None = None, needed: float | None = None) -> None:
        super().__init__(text)
        self.stop, self.needed = stop, needed


@dataclass(frozen=True, eq=False)
class Stop:
    """A peg at ``xy`` (2,) m whose ``radius`` m has half of the DLO's thickness in it, on the DLO's
    left (``side`` 1) or right (-1), or a clip, whose direction is taken either way."""

    xy: FloatArray
    radius: float = 0.0
    side: int = 1
    clip: Clip | None = None


@dataclass(frozen=True, eq=False)
class Route:
    """``slack`` m of the largest gap between the DLO and a peg; ``start`` (2,) of the DLO's first
    point; ``end`` (2,) towards which it goes behind the last stop, None: straight on."""

    stops: Sequence[Stop]
    slack: float
    start: FloatArray
    end: FloatArray | None = None

    def shape(self, length: float, nodes: int) -> FloatArray:
        """(n, 2) of a DLO of this length. Raises Impossible."""
        line = self._line()
        lengths = arc_lengths(line)
        if lengths[-1] > length:
            text = f"the way is {lengths[-1]:.3f} m long, the DLO {length:.3f} m"
            raise Impossible(text, needed=float(lengths[-1]))
        line[-1] += (
            (line[-1] - line[-2]) / (lengths[-1] - lengths[-2]) * max(length - lengths[-1], 0.0)
        )
        return point_at(line, arc_lengths(line), np.linspace(0, length, nodes))

    def missed(self, shape: FloatArray) -> list[int]:
        """Stops at which a DLO (n, 2) is not as the route has it, those in the wrong order too."""
        return _missed(self._places(shape[None])[0].tolist())

    def misses(self, shapes: FloatArray) -> FloatArray:
        """(B,) how many stops each of B DLOs (n, 2) misses."""
        return np.array(
            [len(_missed(places)) for places in self._places(shapes).tolist()], np.float64
        )

    def _places(self, shapes: FloatArray) -> FloatArray:
        """(B, stops) where along each DLO, in edges, it is at a stop as it should be; NaN:
        nowhere."""
        found = [_places(stop, shapes, self.slack) for stop in self.stops]
        return np.stack(found, 1) if found else np.zeros((len(shapes), 0))

    def _line(self) -> FloatArray:
        """The way (k, 2) to the last stop, or to the end that is wished."""
        turns = _turning_points(self)
        headings = [_heading(*pair) for pair in pairwise(turns)]
        points = [self.start]
        for k in range(1, len(turns)):
            arriving, leaving = (
                headings[k - 1],
                headings[k] if k < len(headings) else headings[k - 1],
            )
            points += _around(turns[k], arriving, leaving)
        line = np.array(points)
        steps = np.hypot(*np.diff(line, axis=0).T)
        return np.asarray(line[np.concatenate([[True], steps > 1e-9])])


@dataclass(frozen=True, eq=False)
class _Turn:
    """A circle that the way touches; ``offset`` m is its radius, positive where it is on the
    left."""

    xy: FloatArray
    offset: float = 0.0
    stop: int | None = None


def _turning_points(route: Route) -> list[_Turn]:
    turns = [_Turn(route.start)]
    for k, stop in enumerate(route.stops):
        if stop.clip is None:
            turns.append(_Turn(stop.xy, stop.side * (stop.radius + _KEPT * route.slack), k))
            continue
        ahead = _next_place(route, k) - turns[-1].xy
        way = np.sign(ahead @ stop.clip.along) or 1.0
        reach = stop.clip.length / 2 * way * stop.clip.along
        turns += [_Turn(stop.xy - reach, 0.0, k), _Turn(stop.xy + reach, 0.0, k)]
    return turns if route.end is None else [*turns, _Turn(route.end)]


def _next_place(route: Route, k: int) -> FloatArray:
    if k + 1 < len(route.stops):
        return route.stops[k + 1].xy
    return route.stops[k].xy if route.end is None else route.end


def _heading(here: _Turn, there: _Turn) -> float:
    """Of the straight way that touches both circles. Raises Impossible where one is inside the
    other."""
    between, offset = there.xy - here.xy, there.offset - here.offset
    distance = float(np.hypot(*between))
    if distance <= abs(offset) or distance < 1e-9:
        raise Impossible(
            "is so near to what comes before it that the DLO does not fit between", there.stop
        )
    return float(np.arctan2(between[1], between[0]) - np.arcsin(offset / distance))


def _around(turn: _Turn, arriving: float, leaving: float) -> list[FloatArray]:
    """Points of the way where it touches one circle."""
    if turn.offset == 0:
        return [turn.xy]
    sign = np.sign(turn.offset)
    bend = sign * (leaving - arriving) % (2 * np.pi)
    if bend > _MOST_AROUND:
        back = (leaving - arriving + np.pi) % (2 * np.pi) - np.pi
        headings = np.array([arriving + back / 2])
    else:
        headings = arriving + sign * np.linspace(0, bend, 2 + int(bend / _ARC_RAD))
    left = np.column_stack([-np.sin(headings), np.cos(headings)])
    return list(turn.xy - turn.offset * left)


def _missed(places: list[float]) -> list[int]:
    """Of places along a DLO those that are NaN, or before one that came earlier in the order."""
    missed, last = [], -1.0
    for k, place in enumerate(places):
        if place >= last:
            last = place
        else:
            missed.append(k)
    return missed


def _places(stop: Stop, shapes: FloatArray, slack: float) -> FloatArray:
    """(B,) where along each DLO (n, 2), in edges, it is at a stop as it should be; NaN: nowhere."""
    if stop.clip is not None:
        return in_clips(stop.clip, shapes)
    edges, to_peg = np.diff(shapes, axis=1), stop.xy - shapes[:, :-1]
    share = np.clip((to_peg * edges).sum(-1) / np.maximum((edges**2).sum(-1), 1e-18), 0, 1)
    away = to_peg - share[..., None] * edges
    distance = np.hypot(away[..., 0], away[..., 1])
    every, k = np.arange(len(shapes)), np.argmin(distance, 1)
    (along, off), share, distance = (
        (v[every, k] for v in (edges, away)),
        share[every, k],
        distance[every, k],
    )
    side = along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]
    at_end = ((k == 0) & (share == 0)) | ((k == edges.shape[1] - 1) & (share == 1))
    there = ~at_end & (side * stop.side > 0) & (distance <= stop.radius + slack)
    return np.where(there, k + share, np.nan)
