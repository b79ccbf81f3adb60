"""When a picture was taken, as callers give it."""

from __future__ import annotations

from math import isfinite
from numbers import Real

from dlo_client.errors import InvalidArgument


def time_of(time_s: float | None) -> float | None:
    """``time_s``, seconds from 0 on, or None. Raises InvalidArgument."""
    if time_s is None:
        return None
    if not isinstance(time_s, Real) or not isfinite(time_s) or time_s < 0:
        raise InvalidArgument("time_s", f"{time_s!r} is no number of seconds from 0 on")
    return float(time_s)
