"""Whether strands lie upon one another where they meet: seen in depth, whatever the outlines look
like.

Where a harness branches, its bundle is as high as the joint. Where a strand is upon another one,
the place they share is nearer to the camera than all arms some widths away: also where a free end
hardly passes the other strand, which a mask shows as a branch-point.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.geometry.polylines import arc_lengths, point_at
from models.strands.graph import Web
from models.topology.order import Surface
from models.topology.sites import Arm, bend

_AWAY = np.linspace(2.5, 4.5, 5)
"""Where along an arm its own height is read, in widths of the widest one: beyond what the other
lifts …"""
_BESIDE = np.linspace(0.0, 0.75, 4)[:, None] + np.linspace(-0.15, 0.15, 3)
"""… and ``(4, 3)`` where that of the joint is: a mask's joint is up to half a width beside the
place where they cross. The median of every three counts."""
_LEAST = 5.0
"""Standard deviations of a depth by which a joint that is raised stands out."""
_HALF = 0.5
"""Share of the thickness of the thinnest arm by which a joint stands out at least."""
_OF_CROSSING = ((0.6, 0.3), (1.2, 0.3))
"""By how much the lowest of four arms comes down where two strands cross, and the second highest:
mean and standard deviation, in thicknesses of the thinnest one (17 crossings of rendered harnesses,
scenes 2000 to 2059 of ``bench_harness_depth``; where none was, the lowest arm of nine rose by .3 to
7 mm)."""
_MOST_ODDS = 3.0
"""One reading of the depth speaks for no more than this, either way."""


def raised_odds(depths: Sequence[Surface], web: Web, arms: Sequence[Arm]) -> float:
    """Log odds, -3 to 3, for strands that lie upon one another: above 0 where all arms come down
    from the place they meet; below 0 where they do not come down by as much as they are thick."""
    odds = [
        _odds(_drops(depth, web, arms), _thickness(depth, web, arms), depth) for depth in depths
    ]
    return max(odds, default=0.0, key=abs)


def touching(depths: Sequence[Surface], web: Web, arms: Sequence[Arm]) -> tuple[int, float] | None:
    """Of three arms that meet the one that is upon or under the strand of the two others, and the
    probability that it does; None where no depth shows it."""
    odds = raised_odds(depths, web, arms)
    stem = max(range(3), key=lambda k: -bend(arms[k - 1], arms[k - 2]))
    return (stem, 1 / (1 + float(np.exp(-odds)))) if odds > 0 else None


def _odds(drops: Sequence[float], thickness: float, depth: Surface) -> float:
    """All arms must come down, by half of what the thinnest is thick: a bundle stays as high as
    where it branches, and a strand may go over another one farther on. Where not even so much is
    seen, that speaks against a crossing."""
    lowest = min(drops)
    if not np.isfinite(lowest):
        return 0.0
    raised = (lowest - max(_LEAST * depth.noise, _HALF * thickness)) / depth.noise
    if raised > 0 or len(drops) != 4:
        return float(np.clip(raised, 0.0, _MOST_ODDS))
    flat = min(
        _log_ratio(drop, mean * thickness, float(np.hypot(depth.noise, spread * thickness)))
        for drop, (mean, spread) in zip((lowest, sorted(drops)[2]), _OF_CROSSING, strict=True)
    )
    return float(np.clip(flat, -_MOST_ODDS, 0.0))


def _log_ratio(value: float, mean: float, spread: float) -> float:
    """Log of how much likelier a ``value`` is about ``mean`` than about 0, with the standard
    deviation ``spread``."""
    return (2 * value * mean - mean**2) / (2 * spread**2)


def _thickness(depth: Surface, web: Web, arms: Sequence[Arm]) -> float:
    """M of the thinnest arm; 0 where it is not known."""
    if depth.focal_px is None:
        return 0.0
    places = np.concatenate([web.strands[a.strand].xy for a in arms])
    away = depth.read(places)
    known = away[np.isfinite(away)]
    return (
        min(a.width for a in arms) * float(np.median(known)) / depth.focal_px if len(known) else 0.0
    )


def _drops(depth: Surface, web: Web, arms: Sequence[Arm]) -> list[float]:
    """By how much each arm is farther from the camera some widths away than where they meet, m; all
    NaN where that is not known of one."""
    reach = max(a.width for a in arms)
    lines = [s.xy if a.end == 0 else s.xy[::-1] for a in arms for s in (web.strands[a.strand],)]
    lengths = [arc_lengths(line) for line in lines]
    near = np.stack(
        [
            depth.read(point_at(line, at, np.clip(_BESIDE * reach, 0, at[-1]).ravel()))
            for line, at in zip(lines, lengths, strict=True)
        ]
    ).reshape(-1, _BESIDE.shape[1])
    far = np.stack(
        [
            depth.read(point_at(line, at, np.minimum(_AWAY * reach, at[-1])))[..., 0]
            for line, at in zip(lines, lengths, strict=True)
        ]
    )
    known = np.isfinite(near).all(axis=1)
    if (
        not known.any()
        or np.isnan(far).all(axis=1).any()
        or min(at[-1] for at in lengths) < _AWAY[0] * reach
    ):
        return [float("nan")] * len(arms)
    return (np.nanmedian(far, axis=1) - np.median(near[known], axis=1).min()).tolist()
