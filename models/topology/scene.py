"""The topology of what a picture shows: sections, branch-points, crossings, and the graph they were
read from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.sampling import at_scale, point_at_scale

EndKind = Literal["branch", "free", "border"]
Status = Literal["branched", "plain", "closed", "empty", "unsure", "too_complex"]


@dataclass(frozen=True, eq=False)
class Section:
    """The strand between two branch-points or free ends. ``xy``: ``(n, 2)``; ``width`` px;
    ``ends``: kinds at the first and the last point; ``branches``: indices of the branch-points
    there or -1; ``closed``: a ring; ``score``: share of it on foreground; ``end_widths``: the
    largest near either end, px: a connector shows there."""

    xy: FloatArray
    width: float
    length: float
    ends: tuple[EndKind, EndKind]
    branches: tuple[int, int]
    closed: bool = False
    score: float = 1.0
    end_widths: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """``sections``: indices of those that meet here; ``score``: probability that this is one."""

    xy: tuple[float, float]
    sections: tuple[int, ...]
    score: float


@dataclass(frozen=True, eq=False)
class Place:
    """A place on a section: ``u`` from 0 to 1 by arc length."""

    section: int
    u: float


@dataclass(frozen=True, eq=False)
class Crossing:
    """Two strands pass over one another. ``score``: probability that it is a crossing;
    ``order_score``: of ``over`` being above, 0.5 when unknown."""

    xy: tuple[float, float]
    over: Place
    under: Place
    score: float
    order_score: float = 0.5


@dataclass(frozen=True, eq=False)
class Topology:
    """Everything found. ``nodes_xy``: ``(N, 2)``; ``node_angles``: ``(N,)`` radians;
    ``node_classes``: ``(N, 2)`` probabilities (branch-point, crossing); ``links``: ``(L, 2)`` the
    final graph's edges with ``link_scores``."""

    size: tuple[int, int]
    status: Status
    sections: tuple[Section, ...]
    branch_points: tuple[BranchPoint, ...]
    crossings: tuple[Crossing, ...]
    nodes_xy: FloatArray
    node_angles: FloatArray
    node_classes: FloatArray
    links: IntArray
    link_scores: FloatArray
    timings_ms: dict[str, float] = field(default_factory=dict)

    def at_scale(self, scale: float | FloatArray) -> Topology:
        """All places and lengths with ``scale`` pixels, one or (x, y), for each."""
        size = float(np.mean(scale))
        sections = (
            replace(
                s,
                xy=at_scale(s.xy, scale),
                width=s.width * size,
                length=s.length * size,
                end_widths=(s.end_widths[0] * size, s.end_widths[1] * size),
            )
            for s in self.sections
        )
        branches = (replace(b, xy=point_at_scale(b.xy, scale)) for b in self.branch_points)
        crossings = (replace(c, xy=point_at_scale(c.xy, scale)) for c in self.crossings)
        return replace(
            self,
            sections=tuple(sections),
            branch_points=tuple(branches),
            crossings=tuple(crossings),
            nodes_xy=at_scale(self.nodes_xy, scale),
        )


@dataclass(frozen=True, eq=False)
class Predictions:
    """What the networks give: ``links`` ``(E,)`` probabilities, ``angles`` ``(N,)`` radians,
    ``classes`` ``(N, 2)``."""

    links: FloatArray
    angles: FloatArray
    classes: FloatArray
