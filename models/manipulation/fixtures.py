"""What stands on the table: pegs, edges that a DLO cannot cross, and clips that hold it across
their direction.

Strategy: pegs and edges are capsules, a segment with a radius; a peg's segment has no length. Half
of the DLO's thickness is part of the radius, so the DLO is a line. A clip is entered from above, by
the gripper that presses the DLO in; it is no obstacle before and holds the DLO from then on, which
may still slide along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from models.geometry.polylines import intersections
from models.manipulation.frames import FloatArray

_SOFT_M, _PRESSED_M = 1.5e-3, 3e-3
"""What a DLO in a clip, or what is seen of it, may be beyond the clip's sides; and one that is
still pressed in."""


@dataclass(frozen=True, eq=False)
class Clip:
    """``xy`` (2,) m of its middle, ``angle`` rad of the DLO in it, ``play`` m that the DLO's middle
    line may be off to either side, ``length`` m of the part that it holds."""

    xy: FloatArray
    angle: float
    play: float
    length: float = 0.02

    @property
    def along(self) -> FloatArray:
        return np.array([np.cos(self.angle), np.sin(self.angle)])

    @property
    def across(self) -> FloatArray:
        return np.array([-np.sin(self.angle), np.cos(self.angle)])


@dataclass(frozen=True, eq=False)
class Fixtures:
    """C capsules: ``start`` and ``end`` (C, 2) m, ``radius`` (C,) m with half of the DLO's
    thickness; and clips."""

    start: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    end: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    radius: FloatArray = field(default_factory=lambda: np.zeros(0))
    clips: Sequence[Clip] = ()

    @property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Ends of all capsules, a peg's once, (E, 2), and their radii (E,)."""
        long = np.hypot(*(self.end - self.start).T) > 0
        points = np.concatenate([self.start, self.end[long]])
        return points, np.concatenate([self.radius, self.radius[long]])

    def filled(self, shapes: FloatArray) -> NDArray[np.bool_]:
        """(B, clips) which clips each of B DLOs (n, 2) is in, or gets into when it is let go
        there."""
        found = [np.isfinite(in_clips(clip, shapes, _PRESSED_M)) for clip in self.clips]
        return np.stack(found, 1) if found else np.zeros((len(shapes), 0), bool)

    def gap(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """(S, C) m between segments and capsules; negative where they overlap."""
        return segment_distance(starts, ends, self.start, self.end) - self.radius


def in_clip(clip: Clip, shape: FloatArray) -> float | None:
    """Where along a DLO (n, 2), in edges from its first point, it is in the clip. None: it is
    not."""
    place = float(in_clips(clip, shape[None])[0])
    return None if np.isnan(place) else place


def in_clips(clip: Clip, shapes: FloatArray, soft_m: float = _SOFT_M) -> FloatArray:
    """(B,) where along each of B DLOs (n, 2), in edges from its first point, it is in the clip: it
    passes both of the clip's ends within the play and ``soft_m``. NaN: it is not."""
    (first, one), (second, other) = (_pass(clip, shapes, side) for side in (-0.5, 0.5))
    # Both ends by the same stretch of the DLO, not by two that lie side by side.
    edges = np.diff(shapes, axis=1)
    apart = np.abs(second - first) * np.hypot(edges[..., 0], edges[..., 1]).mean(1)
    inside = (np.maximum(one, other) <= clip.play + soft_m) & (apart < 2 * clip.length)
    return np.where(inside, (first + second) / 2, np.nan)


def _pass(clip: Clip, shapes: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Where along each DLO, in edges, it passes one end of a clip, and how far m beside it;
    infinitely if it does not."""
    middle = clip.xy + side * clip.length * clip.along
    ahead = (shapes - middle) @ clip.along
    step = np.diff(ahead, axis=1)
    share = np.clip(-ahead[:, :-1] / np.where(step == 0, 1.0, step), 0, 1)
    place = shapes[:, :-1] + share[..., None] * np.diff(shapes, axis=1)
    beside = np.where(
        ahead[:, :-1] * ahead[:, 1:] <= 0, np.abs((place - middle) @ clip.across), np.inf
    )
    every, k = np.arange(len(shapes)), np.argmin(beside, 1)
    return k + share[every, k], beside[every, k]


def segment_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """(S, C) m between the segments a to b (S, 2) and those c to d (C, 2); 0 where they cross."""
    away = np.minimum(
        np.minimum(_to_segment(c, a, b), _to_segment(d, a, b)),
        np.minimum(_to_segment(a, c, d), _to_segment(b, c, d)).T,
    )
    i, j, _ = intersections((a, b), (c, d))
    away[i, j] = 0.0
    return away


def _to_segment(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(S, P) m from every point (P, 2) to every segment (S, 2)."""
    line, to_point = (end - start)[:, None], points[None] - start[:, None]
    square = np.maximum((line**2).sum(-1), 1e-18)
    share = np.clip((to_point * line).sum(-1) / square, 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(to_point - share[..., None] * line, -1, 0)))
