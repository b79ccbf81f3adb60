"""Numbers of any size, and shapes made of them: ordinary ones mostly, so that requests get past the
first check."""

from __future__ import annotations

import math

from hypothesis import strategies as st

TINY = (0.0, -0.0, 1e-320, 1e-300, -1e-300, 1e-12, 1e-9, 1e-6)
HUGE = (1e3, -1e3, 1e4, 1e6, 1e9, 1e12, 1e300, -1e300)
Points = list[list[float]]
calm = st.shared(st.integers(0, 2), key="calm").map(bool)
"""Whether a request, all of it, holds nothing odd: two of three, or hardly any would get past the
contract."""


def number(low: float, high: float, wild: float = 0.02) -> st.SearchStrategy[float]:
    """Between ``low`` and ``high``; a share of ``wild`` is at a bound, tiny, huge or negative."""
    usual = st.floats(low, high, allow_subnormal=False)
    odd = st.sampled_from([low, high, -low, -high, *TINY, *HUGE])
    return _mixed(usual, odd, wild)


def optional(inner: st.SearchStrategy) -> st.SearchStrategy:
    return st.one_of(st.none(), inner)


def _mixed(
    usual: st.SearchStrategy, odd: st.SearchStrategy, wild: float = 0.08
) -> st.SearchStrategy:
    rolled = st.integers(0, 999).flatmap(lambda k: odd if k >= 1000 * (1 - wild) else usual)
    return either(usual, rolled)


def either(usual: st.SearchStrategy, odd: st.SearchStrategy) -> st.SearchStrategy:
    """The first in calm requests, the second in others."""
    return calm.flatmap(lambda is_calm: usual if is_calm else odd)


@st.composite
def polyline(draw: st.DrawFn, dimensions: int, size: float, most: int = 40) -> Points:
    """Points in ``dimensions`` along something about ``size`` long: a line, an arc, a ring, a fold,
    a cloud, a spot, a mixture of scales."""
    count = draw(st.integers(2, most))
    scale = draw(_mixed(st.just(size), st.sampled_from([1e-9, 1e-4, 1e-2, 10.0, 1e3])))
    plain, odd = ("line", "arc"), ("line", "arc", "fold", "cloud", "spot", "ring", "scales")
    match draw(either(st.sampled_from(plain), st.sampled_from(odd))):
        case "line":
            flat = [(scale * k / (count - 1), 0.0) for k in range(count)]
        case "arc":
            flat = [
                (scale * math.sin(2 * k / count), scale * math.cos(2 * k / count))
                for k in range(count)
            ]
        case "ring":
            turn = 2 * math.pi / (count - 1)
            flat = [(scale * math.sin(turn * k), scale * math.cos(turn * k)) for k in range(count)]
        case "fold":
            flat = [(scale * (k % 2), 0.0) for k in range(count)]
        case "spot":
            flat = [(scale, scale)] * (count - 1) + [(scale, scale + draw(number(0, size)))]
        case "cloud":
            flat = [
                (draw(number(-scale, scale, 0.0)), draw(number(-scale, scale, 0.0)))
                for _ in range(count)
            ]
        case _:
            flat = [
                (scale * 10.0 ** -draw(st.integers(0, 12)), scale * 0.1**k) for k in range(count)
            ]
    x0, y0, z0 = (draw(number(-0.1, 0.1, 0.03)) for _ in range(3))
    return [[x + x0, y + y0, z0][:dimensions] for x, y in flat]


@st.composite
def pose(draw: st.DrawFn) -> Points:
    """Looking down from about 0.4 m, or turned, or not a pose at all."""
    down = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
    turned = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    skew = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]
    rotation = draw(
        either(
            st.just(down), st.sampled_from([down, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], turned, skew])
        )
    )
    place = (draw(number(-0.05, 0.05)), draw(number(-0.02, 0.02)), draw(number(0.25, 0.4)))
    return [[*row, t] for row, t in zip(rotation, place, strict=True)] + [[0, 0, 0, 1]]
