"""Foreign numbers and points, checked before anything is done with them. All functions raise
Refused."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dlo_client.contracts import Point
from dlo_client.labelling.formats.exchange import Refused
from dlo_client.labelling.formats.pixels import Ring

MOST_POINTS = 100_000
"""Of one outline or line."""
LONGEST_PX = 4_000_000
"""Of one outline or line: what is filled costs memory by its length."""
_OUTSIDE_PX = 100
"""How far beside a small picture a point may lie."""
_MOST_DIGITS = 40


def number(value: object, what: str) -> float:
    """A finite number, or its text."""
    if isinstance(value, str) and len(value) > _MOST_DIGITS:
        raise Refused(f"{what} is no number")
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise TypeError
        got = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise Refused(f"{what} is no number: {str(value)[:40]!r}") from error
    if not math.isfinite(got):
        raise Refused(f"{what} is not finite: {got}")
    return got


def whole(value: object, what: str, least: int, most: int) -> int:
    """A whole number from ``least`` to ``most``, or its text."""
    got = number(value, what)
    if got != math.floor(got) or not least <= got <= most:
        raise Refused(f"{what} is {got:g}, not a whole number from {least} to {most}")
    return int(got)


def yes(value: object) -> bool:
    """How tools write that something holds."""
    return value is True or str(value).strip().casefold() in ("true", "1", "yes", "on")


def pairs(values: object, what: str) -> Ring:
    """(n, 2) numbers from pairs, or from one list x, y, x, y, …"""
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        raise Refused(f"{what} has no list of points")
    if len(values) > 2 * MOST_POINTS:
        raise Refused(f"{what} has more than {MOST_POINTS} points")
    try:
        got = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise Refused(f"{what} has points that are no pairs of numbers") from error
    if got.ndim == 1 and got.size % 2 == 0:
        got = got.reshape(-1, 2)
    if got.ndim != 2 or got.shape[1] != 2:
        raise Refused(f"{what} has points that are no pairs of numbers")
    return got


def inside(points: Ring, width: int, height: int, what: str) -> Ring:
    """The points, if they are finite, not too many, in or near the picture, and the way along them
    is not endless."""
    if len(points) > MOST_POINTS:
        raise Refused(f"{what} has more than {MOST_POINTS} points")
    if not np.isfinite(points).all():
        raise Refused(f"{what} has a coordinate that is not finite")
    size = np.array([width, height], float)
    margin = np.maximum(size, _OUTSIDE_PX)
    far = np.flatnonzero(((points < -margin) | (points > size + margin)).any(1))
    if len(far):
        x, y = points[far[0]]
        raise Refused(
            f"{what} has the point ({x:g}, {y:g}), far outside the picture of {width}×{height}"
        )
    if len(points) and np.abs(np.diff(points, axis=0, append=points[:1])).sum() > LONGEST_PX:
        raise Refused(f"{what} is longer than {LONGEST_PX} px")
    return points


def there(ring: Ring) -> Ring | None:
    """The way there, of a ring that goes the same way back; None of any other."""
    half = len(ring) // 2 + 1
    way, back = ring[:half], ring[half:][::-1]
    first = 1 - len(ring) % 2
    return way if len(ring) >= 2 and np.allclose(back, way[first : first + len(back)]) else None


def chained(lines: Sequence[Ring]) -> Ring:
    """All lines as one: from the first on, each time the end that is nearest to either end of what
    there is."""
    whole_line, rest = lines[0], list(lines[1:])
    while rest:
        ways = [
            (float(np.hypot(*(end - start))), k, front, back)
            for k, line in enumerate(rest)
            for end, front in ((whole_line[-1], False), (whole_line[0], True))
            for start, back in ((line[0], False), (line[-1], True))
        ]
        _, k, front, back = min(ways)
        line = rest.pop(k)
        if front:
            whole_line = np.concatenate([line if back else line[::-1], whole_line])
        else:
            whole_line = np.concatenate([whole_line, line[::-1] if back else line])
    return whole_line


def as_points(line: Ring) -> list[Point]:
    """As labels hold them."""
    return [(round(float(x), 4), round(float(y), 4)) for x, y in line]
