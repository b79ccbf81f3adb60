"""Places where strands meet, and the evidence there: is it a branch-point or a crossing (thesis
6.6.2, extended)?

The thesis decides by the number of arms. Here every joint of four arms, and every two joints of
three arms that a short strand joins, is a *site*; widths, angles, how far apart the joints are and
what the network gives for the nodes there are its evidence. A small network turns it into
probabilities of the readings: branch-points; a crossing; or a *lens*, two strands that cross at
either joint and lie upon one another in between.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.directions import angle_between, unit
from models.geometry.polylines import arc_lengths, point_at
from models.strands.ends import width_of
from models.strands.graph import Strand, Web
from models.topology.scene import Predictions

_LONGEST_MIDDLE = 9.0
"""A middle strand of more widths than this is a bundle, no crossing."""
_NEAR_PX = 60
"""How far beyond a joint's disc the width of an arm is measured."""


class Reading(IntEnum):
    """What a site may be; the columns of the classifier's answer."""

    BRANCH_POINTS = 0
    CROSSING = 1
    LENS = 2


@dataclass(frozen=True, eq=False)
class Arm:
    """One strand as it leaves a site: ``end`` 0 or 1 of strand ``strand``; ``xy`` where it leaves
    the joint's disc, ``heading`` (2,) outward, ``width`` px, ``knot``."""

    strand: int
    end: int
    knot: int
    xy: FloatArray
    heading: FloatArray
    width: float


@dataclass(frozen=True, eq=False)
class Site:
    """``arms`` by angle, counter-clockwise in the picture's axes; ``middle``: index of the strand
    between two joints, or None. ``pairs``: the arms (indices) that a crossing would join;
    ``rivals``: the other way to pair them, which two crossings would, one at each joint."""

    knots: tuple[int, ...]
    arms: tuple[Arm, ...]
    middle: int | None
    xy: FloatArray
    pairs: tuple[tuple[int, int], tuple[int, int]]
    rivals: tuple[tuple[int, int], tuple[int, int]]


def ends_at(web: Web) -> dict[int, list[tuple[int, int]]]:
    """``(strand, end)`` of all strands at each knot."""
    found: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for k, strand in enumerate(web.strands):
        found[strand.a].append((k, 0))
        found[strand.b].append((k, 1))
    return found


def measure_arm(web: Web, strand: int, end: int) -> Arm:
    """Direction, over three widths, and width of a strand where it leaves its knot's disc."""
    whole = web.strands[strand]
    seen = whole if end == 0 else whole.reversed()
    lengths = arc_lengths(seen.xy)
    total = float(lengths[-1])
    width = _width_beyond(seen, lengths)
    start = min(float(seen.radii[0]), 0.5 * total)
    stop = min(start + 3 * width, total)
    near, far = point_at(seen.xy, lengths, np.array([start, stop]))
    return Arm(strand, end, seen.a, near, unit(far - near), width)


def _width_beyond(seen: Strand, lengths: FloatArray) -> float:
    """Typical width outside the joint's disc, near it."""
    disc = float(seen.radii[0])
    outside = (lengths >= min(disc, 0.5 * lengths[-1])) & (lengths <= disc + _NEAR_PX)
    return width_of(seen.radii[outside] if outside.any() else seen.radii)


def crossing_sites(web: Web) -> list[Site]:
    """Every place that might be a crossing of two strands."""
    at = ends_at(web)
    sites = []
    for knot, ends in at.items():
        if len(ends) == 4:
            sites.append(_single(web, knot, ends))
    for k, strand in enumerate(web.strands):
        three = strand.a != strand.b and len(at[strand.a]) == 3 and len(at[strand.b]) == 3
        width = width_of(strand.radii)
        if three and strand.length <= _LONGEST_MIDDLE * width:
            sites.append(_double(web, k, at))
    return sites


def _single(web: Web, knot: int, ends: list[tuple[int, int]]) -> Site:
    arms = tuple(
        sorted(
            (measure_arm(web, s, e) for s, e in ends),
            key=lambda a: np.arctan2(a.heading[1], a.heading[0]),
        )
    )
    rivals = (((0, 1), (2, 3)), ((1, 2), (3, 0)))
    smoother = min(rivals, key=lambda pairs: sum(bend(arms[i], arms[j]) for i, j in pairs))
    return Site((knot,), arms, None, web.knots_xy[knot], ((0, 2), (1, 3)), smoother)


def _double(web: Web, middle: int, at: dict[int, list[tuple[int, int]]]) -> Site:
    strand = web.strands[middle]
    axis = web.knots_xy[strand.b] - web.knots_xy[strand.a]
    first = [measure_arm(web, s, e) for s, e in at[strand.a] if s != middle]
    last = [measure_arm(web, s, e) for s, e in at[strand.b] if s != middle]
    # By side of the axis: a crossing joins the arms on opposite sides, two branch-points those on
    # the same side.
    first.sort(key=lambda a: _side(a, web.knots_xy[strand.a], axis))
    last.sort(key=lambda a: _side(a, web.knots_xy[strand.b], axis))
    lengths = arc_lengths(strand.xy)
    center = point_at(strand.xy, lengths, np.array([lengths[-1] / 2]))[0]
    return Site(
        (strand.a, strand.b), (*first, *last), middle, center, ((0, 3), (1, 2)), ((0, 2), (1, 3))
    )


def _side(arm: Arm, knot_xy: FloatArray, axis: FloatArray) -> float:
    reach = arm.xy + 2 * arm.width * arm.heading - knot_xy
    return float(axis[0] * reach[1] - axis[1] * reach[0])


def bend(one: Arm, other: Arm) -> float:
    """How much a strand through both arms turns in all, radians: 0 straight, up to 2 pi."""
    chord = other.xy - one.xy
    size = float(np.hypot(*chord))
    if size == 0:
        return float(angle_between(-one.heading, other.heading))
    chord = chord / size
    return float(angle_between(-one.heading, chord) + angle_between(chord, other.heading))


def least_bend(arms: Sequence[Arm]) -> float:
    """Of the straightest pair; of fewer than two arms that of turning back."""
    return min((bend(a, b) for i, a in enumerate(arms) for b in arms[i + 1 :]), default=np.pi)


class SiteEvidence(NamedTuple):
    """What speaks for a reading of a site: length and widths of the middle (:func:`_middle`);
    bends, radians, and width changes, log ratios, of the pairs that a crossing would join and of
    the rivals; angles between arms; what the networks give for the nodes nearby; narrowest arm over
    widest; how the middle's width runs; what the networks give for the less certain joint."""

    middle_length: float
    middle_least: float
    middle_typical: float
    middle_largest: float
    bend_larger: float
    bend_sum: float
    rival_bend_larger: float
    rival_bend_sum: float
    change_larger: float
    change_sum: float
    rival_change_sum: float
    opening_smaller: float
    opening_larger: float
    crossing_angle: float
    branch: float
    crossing: float
    width_ratio: float
    middle_half_way: float
    middle_fifth_smaller: float
    middle_fifth_larger: float
    joint_branch: float
    joint_crossing: float


def evidence(site: Site, web: Web, nodes_xy: FloatArray, predictions: Predictions) -> SiteEvidence:
    arms = site.arms
    widths = np.array([a.width for a in arms])
    through = [bend(arms[i], arms[j]) for i, j in site.pairs]
    rival = [bend(arms[i], arms[j]) for i, j in site.rivals]
    change = [abs(np.log(arms[i].width / arms[j].width)) for i, j in site.pairs]
    rival_change = [abs(np.log(arms[i].width / arms[j].width)) for i, j in site.rivals]
    openings = [float(angle_between(arms[i].heading, arms[j].heading)) for i, j in ((0, 1), (2, 3))]
    first, second = (unit(arms[i].heading - arms[j].heading) for i, j in site.pairs)
    crossing = float(np.arccos(min(1.0, abs(float(first @ second)))))
    reach = float(widths.max())
    branch, cross = _classes_near(site.xy, nodes_xy, predictions, reach)
    joints = [_classes_near(web.knots_xy[k], nodes_xy, predictions, reach) for k in site.knots]
    length, least, typical, largest, half_way, smaller, larger = _middle(site, web, widths)
    joint_branch, joint_crossing = np.min(joints, axis=0).tolist()
    return SiteEvidence(
        middle_length=length,
        middle_least=least,
        middle_typical=typical,
        middle_largest=largest,
        bend_larger=max(through),
        bend_sum=sum(through),
        rival_bend_larger=max(rival),
        rival_bend_sum=sum(rival),
        change_larger=float(max(change)),
        change_sum=float(sum(change)),
        rival_change_sum=float(sum(rival_change)),
        opening_smaller=min(openings),
        opening_larger=max(openings),
        crossing_angle=crossing,
        branch=branch,
        crossing=cross,
        width_ratio=float(widths.min() / widths.max()),
        middle_half_way=half_way,
        middle_fifth_smaller=smaller,
        middle_fifth_larger=larger,
        joint_branch=joint_branch,
        joint_crossing=joint_crossing,
    )


def _middle(site: Site, web: Web, widths: FloatArray) -> tuple[float, ...]:
    """Length of the middle strand; its least, typical and largest width; its width half way, and
    the smaller and the larger of those a fifth from its ends: where strands that lie upon one
    another cross, they are as wide as one. All in typical widths of the arms."""
    scale = float(widths.mean())
    if site.middle is None:
        knot = 2 * max(
            float(web.strands[a.strand].radii[0 if a.end == 0 else -1]) for a in site.arms
        )
        return 0.0, *[knot / scale] * 6
    strand = web.strands[site.middle]
    radii = strand.radii
    first, half_way, last = (
        float(radii[round(share * (len(radii) - 1))]) for share in (0.2, 0.5, 0.8)
    )
    shown = (
        *(float(f(radii)) for f in (np.min, np.median, np.max)),
        half_way,
        min(first, last),
        max(first, last),
    )
    return strand.length / scale, *(2 * radius / scale for radius in shown)


def _classes_near(
    xy: FloatArray, nodes_xy: FloatArray, predictions: Predictions, width: float
) -> tuple[float, float]:
    """Strongest class scores among the nodes within a width of a place, or of its nearest node."""
    away = np.hypot(*(nodes_xy - xy).T)
    near = away <= max(width, float(away.min()))
    branch, cross = predictions.classes[near].max(axis=0).tolist()
    return branch, cross
