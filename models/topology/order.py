"""Which strand is on top at a crossing: from the picture, a depth map, or points in space (thesis
6.7, line 4).

One rule for all three: what is seen along the upper strand runs through the crossing unchanged;
along the lower one it is interrupted. Nothing seen, or no difference: the order stays unknown
(score 0.5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from models.geometry.arrays import ByteArray, Float32Array, FloatArray
from models.geometry.directions import middle_lanes, quarter_turned, unit
from models.geometry.polylines import arc_lengths, point_at
from models.geometry.sampling import read_nearest
from models.strands.seen import LEAST_SINE, NOISE_LEVELS
from models.topology.scene import Crossing, Place, Section

_DEPTH_NOISE_M = 0.001
"""Meters that mean nothing: the noise of a good depth camera near the table."""
_MOST_DEPTH_ODDS = 3.0
_NEAR_WIDTHS, _NEAR_PX = 3.0, 8.0
"""About a crossing so far along a strand the place is looked for where the lines meet."""
_PARTED_PX = 0.5
"""Beside each other with so much room, in px, the outlines of two strands have parted."""
_LEAST_ARM_PX, _ARM_WIDTHS = 6.0, 1.5
"""So far beyond a crossing is looked, in px at least and in widths …"""
_PARTED_SHARE = 0.25
"""… and this share of it where outlines part: an upper strand comes down soon."""
_ACROSS, _BESIDE = 9, 6
"""Samples along the crossing, and before and after it."""
_SHARPNESS = 1.5
"""How fast the score follows the ratio of the deviations."""


class Stretch(Protocol):
    """What a section and a cable have in common: ``xy`` (n, 2) px in order, and the width, px."""

    @property
    def xy(self) -> FloatArray: ...

    @property
    def width(self) -> float: ...


@dataclass(frozen=True)
class Surface:
    """Something seen over the picture: ``read`` takes ``(…, 2)`` places to ``(…, C)`` values, NaN
    where nothing is known; ``noise`` is a standard deviation that means nothing; ``is_depth``: what
    is nearer also speaks for on top; ``focal_px`` of the camera of a depth, where it is known: how
    thick strands are then follows from their widths."""

    read: Callable[[FloatArray], FloatArray]
    noise: float
    is_depth: bool = False
    focal_px: float | None = None


def picture(image: ByteArray) -> Surface:
    """Colors ``(H, W, 3)``."""
    return Surface(lambda places: read_nearest(image, places), NOISE_LEVELS)


def depth_map(depth_m: Float32Array, focal_px: float | None = None) -> Surface:
    """``(H, W)`` meters to the camera; 0 and NaN are unknown. ``focal_px`` of the camera, where it
    is known."""

    def read(places: FloatArray) -> FloatArray:
        values = read_nearest(depth_m, places)
        return np.where(values > 0, values, np.nan)[..., None]

    return Surface(read, _DEPTH_NOISE_M, is_depth=True, focal_px=focal_px)


def points(xy: FloatArray, depth_m: FloatArray, reach_px: float = 6.0) -> Surface:
    """Points in space as they appear in the picture: ``(n, 2)`` pixels and ``(n,)`` meters to the
    camera."""
    tree = cKDTree(xy)

    def read(places: FloatArray) -> FloatArray:
        away, nearest = tree.query(places, distance_upper_bound=reach_px)
        known = np.isfinite(away)
        values = np.full(away.shape, np.nan)
        values[known] = depth_m[nearest[known]]
        return values[..., None]

    return Surface(read, _DEPTH_NOISE_M, is_depth=True)


def ordered(
    crossings: Sequence[Crossing], sections: Sequence[Section], surfaces: Sequence[Surface]
) -> list[Crossing]:
    """The crossings with the upper strand as ``over``; all surfaces count, weighted by what they
    can tell."""
    return [_order(c, sections, surfaces) for c in crossings]


def _order(
    crossing: Crossing, sections: Sequence[Section], surfaces: Sequence[Surface]
) -> Crossing:
    one, other = crossing.over, crossing.under
    odds = sum(log_odds(one, other, sections, s) for s in surfaces)
    score = 1 / (1 + float(np.exp(-abs(odds))))
    if odds >= 0:
        return replace(crossing, order_score=score)
    return replace(crossing, over=other, under=one, order_score=score)


def log_odds(one: Place, other: Place, sections: Sequence[Stretch], surface: Surface) -> float:
    """Positive if ``one`` runs through unchanged while ``other`` does not; 0 if the surface does
    not tell."""
    one, other = _met(one, other, sections)
    sine = _sine(one, other, sections)
    first = _deviation(one, sections[one.section], sections[other.section].width / sine, surface)
    second = _deviation(other, sections[other.section], sections[one.section].width / sine, surface)
    if first is None or second is None:
        return 0.0
    odds = _SHARPNESS * float(np.log(second[0] / first[0]))
    if surface.is_depth:
        odds += _nearer(second[1] - first[1], surface)
        odds += _nearer(_lifted(one, other, sections, surface), surface)
    return odds


def _nearer(apart_m: float, surface: Surface) -> float:
    return float(np.clip(apart_m / surface.noise, -_MOST_DEPTH_ODDS, _MOST_DEPTH_ODDS))


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A strand about a crossing: arc lengths ``(n,)`` px, about a pixel apart, that of the
    crossing, and ``(n,)`` how far away the other strand is."""

    lengths: FloatArray
    at: float
    away: FloatArray

    def run(self, most: float) -> tuple[int, int]:
        """First and last index of those next to each other that are no farther than ``most`` from
        the other strand, about the one nearest to the crossing."""
        near = np.flatnonzero(self.away <= most)
        if not len(near):
            near = np.array([self.away.argmin()])
        runs = np.split(near, np.flatnonzero(np.diff(near) > 1) + 1)
        run = min(runs, key=lambda r: float(np.abs(self.lengths[r] - self.at).min()))
        return int(run[0]), int(run[-1])


def _stretches(one: Place, other: Place, sections: Sequence[Stretch]) -> tuple[_Stretch, _Stretch]:
    strands = sections[one.section], sections[other.section]
    width = (strands[0].width + strands[1].width) / 2
    reach = _NEAR_WIDTHS * width + _NEAR_PX
    places, at, lines = [], [], []
    for place, strand in zip((one, other), strands, strict=True):
        lengths = arc_lengths(strand.xy)
        at.append(place.u * float(lengths[-1]))
        first, last = np.clip([at[-1] - reach, at[-1] + reach], 0, lengths[-1])
        places.append(np.linspace(first, last, max(2, round(last - first) + 1)))
        lines.append(point_at(strand.xy, lengths, places[-1]))
    away = cdist(*lines)
    if one.section == other.section:  # a strand is not near itself where it is one pass
        away[np.abs(places[0][:, None] - places[1]) < _NEAR_WIDTHS * width] = np.inf
    nearest = away.min(axis=1), away.min(axis=0)
    return _Stretch(places[0], at[0], nearest[0]), _Stretch(places[1], at[1], nearest[1])


def _met(one: Place, other: Place, sections: Sequence[Stretch]) -> tuple[Place, Place]:
    """The places where the two lines meet, or the middle of where they are one: what was walked is
    shorter than the smooth line with its tips, and so its places are some pixels off."""

    def at(place: Place, stretch: _Stretch) -> Place:
        first, last = stretch.run(float(stretch.away.min()) + 1)
        whole = max(float(arc_lengths(sections[place.section].xy)[-1]), 1e-9)
        return replace(place, u=min(1.0, float(stretch.lengths[(first + last) // 2]) / whole))

    of_one, of_other = _stretches(one, other, sections)
    return at(one, of_one), at(other, of_other)


def _lifted(one: Place, other: Place, sections: Sequence[Stretch], depth: Surface) -> float:
    """By how much ``one`` is nearer to the camera than ``other`` (m) right where their outlines
    part, at a flat angle far from where they cross; 0 where that is not seen."""
    width = (sections[one.section].width + sections[other.section].width) / 2
    of_one, of_other = (
        _where_parted(sections[place.section], stretch, width, depth)
        for place, stretch in zip((one, other), _stretches(one, other, sections), strict=True)
    )
    return 0.0 if np.isnan(of_one + of_other) else of_other - of_one


def _where_parted(strand: Stretch, stretch: _Stretch, width: float, depth: Surface) -> float:
    """Mean distance of a strand to the camera (m) where its outline has left that of the other, on
    either side; NaN where that is not seen."""
    lengths = arc_lengths(strand.xy)
    first, last = stretch.run(width + _PARTED_PX)
    beyond = 1 + np.linspace(0, _PARTED_SHARE * _arm(strand), 3)
    at = np.concatenate(
        (
            stretch.lengths[first] - beyond if first > 0 else np.zeros(0),
            stretch.lengths[last] + beyond if last < len(stretch.lengths) - 1 else np.zeros(0),
        )
    )
    seen = _profile(strand, lengths, at[(at >= 0) & (at <= lengths[-1])], depth)
    return float(np.nanmean(seen)) if np.isfinite(seen).any() else float("nan")


def _arm(strand: Stretch) -> float:
    return max(_LEAST_ARM_PX, _ARM_WIDTHS * strand.width)


def _sine(one: Place, other: Place, sections: Sequence[Stretch]) -> float:
    """Sine of the angle between two strands where they cross: at a flat angle they lie on one
    another for longer."""
    headings = []
    for place in (one, other):
        section = sections[place.section]
        lengths = arc_lengths(section.xy)
        near = place.u * lengths[-1] + np.array([-1, 1]) * _arm(section)
        before, after = point_at(section.xy, lengths, np.clip(near, 0, lengths[-1]))
        headings.append(unit(after - before))
    (a, b), (c, d) = headings
    return max(LEAST_SINE, abs(float(a * d - b * c)))


def _deviation(
    place: Place, section: Stretch, overlap: float, surface: Surface
) -> tuple[float, float] | None:
    """Mean squared deviation, noise included, of what is seen in the crossing from what is seen
    before and after, and the mean of the latter right beside the crossing; None where too little is
    seen."""
    lengths = arc_lengths(section.xy)
    at = place.u * lengths[-1]
    half = 0.5 * overlap + 1
    arm = _arm(section)
    inner = np.linspace(at - half, at + half, _ACROSS)
    before, after = (
        np.linspace(at - half - arm, at - half - 2, _BESIDE),
        np.linspace(at + half + 2, at + half + arm, _BESIDE),
    )
    center, left, right = (_profile(section, lengths, s, surface) for s in (inner, before, after))
    if any(np.isnan(part).all(axis=0).any() for part in (center, left, right)):
        return None
    share = np.linspace(0, 1, len(inner))[:, None]
    expected = (1 - share) * np.nanmean(left, axis=0) + share * np.nanmean(right, axis=0)
    beside = float(np.nanmean(np.concatenate((left[-2:], right[:2]))) if surface.is_depth else 0.0)
    return float(np.nanmean((center - expected) ** 2)) + surface.noise**2, beside


def _profile(section: Stretch, lengths: FloatArray, at: FloatArray, surface: Surface) -> FloatArray:
    """``(n, C)`` along the section, averaged over the middle of its width."""
    along = np.clip(at, 0, lengths[-1])
    places = point_at(section.xy, lengths, along)
    ahead = point_at(section.xy, lengths, np.clip(along + 3, 0, lengths[-1]))
    behind = point_at(section.xy, lengths, np.clip(along - 3, 0, lengths[-1]))
    normal = quarter_turned(unit(ahead - behind))
    values = surface.read(places + middle_lanes(normal, section.width))
    known = np.isfinite(values).sum(axis=0)
    out: FloatArray = np.where(known > 0, np.nansum(values, axis=0) / np.maximum(known, 1), np.nan)
    return out
