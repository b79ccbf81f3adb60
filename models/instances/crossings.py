"""Where DLOs cross, and which strand is on top (thesis 3.5.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.directions import middle_lanes, quarter_turned, unit
from models.geometry.polylines import arc_lengths, crossing_segments, point_at
from models.geometry.sampling import read_nearest
from models.instances.scene import Crossing, StrandPosition
from models.strands.seen import LEAST_SINE, NOISE_LEVELS


@dataclass(frozen=True, eq=False)
class Strand:
    """A centerline to look for crossings on: ``(n, 2)`` points, their arc lengths and the width."""

    xy: FloatArray
    lengths: FloatArray
    width: float

    @staticmethod
    def of(centerline_xy: FloatArray, width_px: float) -> Strand:
        return Strand(centerline_xy, arc_lengths(centerline_xy), width_px)


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two strands (``a <= b``, from 0) meet at ``xy``, at these arc lengths; ``sine`` of their
    angle."""

    a: int
    b: int
    at_a: float
    at_b: float
    xy: FloatArray
    sine: float


def find_meetings(strands: list[Strand]) -> list[Meeting]:
    """Every place where two centerlines, or two parts of one, pass through each other.

    Centerlines that run along each other may intersect several times nearby: an even number of
    intersections is no crossing, an odd number is one, at the middle of them.
    """
    if not strands:
        return []
    owner = np.repeat(np.arange(len(strands)), [len(s.xy) - 1 for s in strands])
    starts = np.concatenate([s.xy[:-1] for s in strands])
    ends = np.concatenate([s.xy[1:] for s in strands])
    offsets = np.concatenate([s.lengths[:-1] for s in strands])
    steps = np.hypot(*(ends - starts).T)
    hits = crossing_segments(starts, ends)
    found = []
    for i, j, t, u, xy in zip(*hits, strict=True):
        a, b = int(owner[i]), int(owner[j])
        at_a, at_b = float(offsets[i] + t * steps[i]), float(offsets[j] + u * steps[j])
        first, second = (ends[i] - starts[i]) / steps[i], (ends[j] - starts[j]) / steps[j]
        sine = abs(float(first[0] * second[1] - first[1] * second[0]))
        found.append(Meeting(a, b, at_a, at_b, xy, sine))
    return _without_repeats(found, strands)


def _without_repeats(found: list[Meeting], strands: list[Strand]) -> list[Meeting]:
    kept = []
    waiting = [m for m in found if not _is_curl(m, strands)]
    while waiting:
        near = [m for m in waiting if _is_same_place(m, waiting[0], strands)]
        waiting = [m for m in waiting if m not in near]
        if len(near) % 2:
            kept.append(near[len(near) // 2])
    return kept


def _is_curl(meeting: Meeting, strands: list[Strand]) -> bool:
    """A loop shorter than a cable can bend: an artifact of the fit, not a self-crossing."""
    if meeting.a != meeting.b:
        return False
    strand = strands[meeting.a]
    between = abs(meeting.at_a - meeting.at_b)
    if np.allclose(strand.xy[0], strand.xy[-1], atol=0.1):
        between = min(between, float(strand.lengths[-1]) - between)
    return between < 3 * strand.width


def _is_same_place(one: Meeting, other: Meeting, strands: list[Strand]) -> bool:
    if (one.a, one.b) != (other.a, other.b):
        return False
    reach = 2 * max(strands[one.a].width, strands[one.b].width)
    return abs(one.at_a - other.at_a) < reach and abs(one.at_b - other.at_b) < reach


def order_meetings(
    meetings: list[Meeting], strands: list[Strand], image: ByteArray | None
) -> tuple[Crossing, ...]:
    """The crossings of all meetings, in their order, by :func:`order_meeting`."""
    return tuple(order_meeting(meeting, strands, image) for meeting in meetings)


def order_meeting(meeting: Meeting, strands: list[Strand], image: ByteArray | None) -> Crossing:
    """The crossing with its order: the strand whose color varies less along the crossing is on
    top.

    ``image``: ``(H, W, 3)`` or None (then the order is arbitrary and the score 0.5). The score is
    the share of the color variance that the lower strand has, a fixed noise included on both sides.
    """
    a, b = strands[meeting.a], strands[meeting.b]
    if image is None:
        return ordered(meeting, strands, True, 0.5)
    sine = max(meeting.sine, LEAST_SINE)
    var_a = _color_variance(image, a, meeting.at_a, b.width / sine)
    var_b = _color_variance(image, b, meeting.at_b, a.width / sine)
    score = max(var_a, var_b) / (var_a + var_b)
    return ordered(meeting, strands, var_a <= var_b, score)


def ordered(meeting: Meeting, strands: list[Strand], a_is_over: bool, score: float) -> Crossing:
    """The crossing of a meeting whose order is known with this score."""
    position_a = StrandPosition(meeting.a + 1, _share(meeting.at_a, strands[meeting.a]))
    position_b = StrandPosition(meeting.b + 1, _share(meeting.at_b, strands[meeting.b]))
    over, under = (position_a, position_b) if a_is_over else (position_b, position_a)
    return Crossing((float(meeting.xy[0]), float(meeting.xy[1])), over, under, score)


def _share(at: float, strand: Strand) -> float:
    return min(1.0, max(0.0, at / float(strand.lengths[-1])))


def _color_variance(image: ByteArray, strand: Strand, at: float, other_extent: float) -> float:
    """Mean over R, G, B of the color's variance along the strand, across the other strand and a
    width beyond.

    The color is averaged over the middle half of the strand's width.
    """
    reach = other_extent / 2 + strand.width
    along = np.clip(np.arange(at - reach, at + reach + 1.0), 0.0, strand.lengths[-1])
    points = point_at(strand.xy, strand.lengths, along)
    tangent = points[-1] - points[0]
    lanes = middle_lanes(quarter_turned(unit(tangent)), strand.width)[:, None]
    colors = np.add.reduce(read_nearest(image, points + lanes)) / len(lanes)
    away = colors - np.add.reduce(colors) / len(colors)
    return float(np.vdot(away, away)) / colors.size + NOISE_LEVELS**2
