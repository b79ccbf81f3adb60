"""Which strand lies on which: crossings of a set of curves, and the order in which to paint their
pieces.

Strategy: every cable is cut into pieces between its crossings. All pieces of all cables are painted
in one order, from the lowest to the highest, where a piece's level comes from its own cable's
height there. So one cable passes over another here and under it there, and over itself, and no two
strands cut through each other. The order at a crossing is the painting order of the two pieces that
meet there: what was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from models.synthesis.curves import FloatArray

_STRIDE = 4  # curve samples a segment: 2.8 px
_CHUNK = 8  # segments in one bounding box


@dataclass(frozen=True)
class Meeting:
    """Curves ``first`` and ``second`` (the same one for a self-crossing) meet at ``xy``, at these
    samples."""

    first: int
    second: int
    first_sample: int
    second_sample: int
    xy: tuple[float, float]


@dataclass(frozen=True)
class Piece:
    """Samples ``start`` to ``stop`` (exclusive) of curve ``cable``, painted at ``level``."""

    cable: int
    start: int
    stop: int
    level: float


@dataclass(frozen=True)
class Stack:
    """``pieces`` from the lowest to the highest; ``heights`` per curve (m,), higher at every
    crossing for the strand on top, equal to the piece's level there; ``meetings`` inside and
    outside the picture."""

    pieces: tuple[Piece, ...]
    heights: tuple[FloatArray, ...]
    meetings: tuple[Meeting, ...]

    def rank(self, cable: int, sample: int) -> int:
        """Place in the painting order of the piece that holds ``sample`` of curve ``cable``."""
        return next(
            k for k, p in enumerate(self.pieces) if p.cable == cable and p.start <= sample < p.stop
        )

    def over_and_under(self, meeting: Meeting) -> tuple[tuple[int, int], tuple[int, int]]:
        """(curve, sample) of the strand painted later, and of the other one."""
        passes = (meeting.first, meeting.first_sample), (meeting.second, meeting.second_sample)
        under, over = sorted(passes, key=lambda at: self.rank(*at))
        return over, under


def stack(curves: Sequence[FloatArray], half_widths: Sequence[float]) -> Stack:
    """``curves`` (m, 3) x, y, height; ``half_widths`` px, one a curve (how far apart two crossings
    must be for a cut between them)."""
    meetings = intersections(curves)
    clearance = 2.2 * max(half_widths, default=0.0)
    pieces: list[Piece] = []
    heights: list[FloatArray] = []
    for k, curve in enumerate(curves):
        passes = sorted({s for m in meetings for s in _samples_on(m, k)})
        loops = [_samples_on(m, k) for m in meetings if m.first == m.second == k]
        cuts = _cuts(curve, passes, loops, clearance)
        own = [Piece(k, a, b, _level(curve, passes, a, b)) for a, b in pairwise(cuts)]
        pieces += own
        heights.append(_settled(curve, passes, own))
    return Stack(tuple(sorted(pieces, key=lambda p: p.level)), tuple(heights), tuple(meetings))


def intersections(curves: Sequence[FloatArray]) -> list[Meeting]:
    """Where the x, y parts of the curves cross, each other or themselves. Segments of a few samples
    are compared only where the bounding boxes of their chunks overlap."""
    start, step, cable, sample = _segments(curves)
    if len(start) == 0:
        return []
    a, b = _candidates(start, step)
    apart = (cable[a] != cable[b]) | (sample[b] > sample[a] + _STRIDE)
    a, b = a[apart], b[apart]
    between = start[b] - start[a]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = _cross(step[a], step[b])
        t, u = _cross(between, step[b]) / cross, _cross(between, step[a]) / cross
    hits = np.flatnonzero((t >= 0) & (t < 1) & (u >= 0) & (u < 1))
    return [
        Meeting(
            int(cable[a[i]]),
            int(cable[b[i]]),
            int(sample[a[i]] + t[i] * _STRIDE),
            int(sample[b[i]] + u[i] * _STRIDE),
            (
                float(start[a[i], 0] + t[i] * step[a[i], 0]),
                float(start[a[i], 1] + t[i] * step[a[i], 1]),
            ),
        )
        for i in hits
    ]


def _segments(curves: Sequence[FloatArray]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Start (n, 2), step (n, 2), curve (n,) and first sample (n,) of all segments of all curves."""
    lines = [curve[::_STRIDE, :2] for curve in curves]
    counts = [max(len(line) - 1, 0) for line in lines]
    start = np.concatenate([line[:-1] for line in lines] or [np.zeros((0, 2), np.float32)])
    step = np.concatenate(
        [np.diff(line, axis=0) for line in lines] or [np.zeros((0, 2), np.float32)]
    )
    sample = np.concatenate([np.arange(n) * _STRIDE for n in counts] or [np.zeros(0, int)])
    return start, step, np.repeat(np.arange(len(curves)), counts), sample


def _candidates(start: NDArray, step: NDArray) -> tuple[NDArray, NDArray]:
    """Pairs of segment numbers a < b whose chunks' boxes overlap."""
    edges = np.arange(0, len(start), _CHUNK)
    low = np.minimum.reduceat(np.minimum(start, start + step), edges)
    high = np.maximum.reduceat(np.maximum(start, start + step), edges)
    overlap = (low[:, None] <= high[None]).all(2)
    p, q = np.nonzero(np.triu(overlap & overlap.T))
    inner = np.arange(_CHUNK)
    a = np.broadcast_to(
        (p * _CHUNK)[:, None, None] + inner[:, None], (len(p), _CHUNK, _CHUNK)
    ).ravel()
    b = np.broadcast_to((q * _CHUNK)[:, None, None] + inner, (len(p), _CHUNK, _CHUNK)).ravel()
    valid = (a < b) & (b < len(start))
    return a[valid], b[valid]


def _cross(p: NDArray, q: NDArray) -> NDArray:
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]


def _samples_on(meeting: Meeting, cable: int) -> tuple[int, ...]:
    both = ((meeting.first, meeting.first_sample), (meeting.second, meeting.second_sample))
    return tuple(sample for owner, sample in both if owner == cable)


def _cuts(
    curve: FloatArray, passes: Sequence[int], loops: Sequence[tuple[int, ...]], clearance_px: float
) -> list[int]:
    """Ends of the pieces: halfway between neighboring crossings that are far enough apart; and in
    any case once between the two passes of a self-crossing."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve[:, :2], axis=0).T))])
    cuts = [(a + b) // 2 for a, b in pairwise(passes) if length[b] - length[a] > clearance_px]
    for a, b in sorted(loops, key=lambda pair: pair[1] - pair[0]):
        if not any(a < cut <= b for cut in cuts):
            cuts.append((a + b) // 2 + 1)
    return [0, *sorted(cuts), len(curve)]


def _level(curve: FloatArray, passes: Sequence[int], start: int, stop: int) -> float:
    inside = [s for s in passes if start <= s < stop] or slice(start, stop)
    return float(curve[inside, 2].mean())


def _settled(curve: FloatArray, passes: Sequence[int], pieces: Sequence[Piece]) -> FloatArray:
    """Heights (m,) that pass through the level of its piece at every crossing, straight in
    between."""
    if not passes:
        return curve[:, 2]
    levels = [next(p.level for p in pieces if p.start <= s < p.stop) for s in passes]
    return np.interp(np.arange(len(curve)), passes, levels).astype(np.float32)
