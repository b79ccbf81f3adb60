"""What every instance method returns: the DLOs of one picture and where they cross."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.sampling import at_scale, point_at_scale
from models.geometry.splines import Spline

EndpointKind = Literal["free", "border", "hidden"]
Reason = Literal[
    "gap",
    "border",
    "parallel",
    "low_contrast",
    "blur",
    "lookalike",
    "free_ends",
    "short",
    "odd_width",
    "no_picture",
    "crossing",
    "order",
]


@dataclass(frozen=True, eq=False)
class Endpoint:
    """Where a DLO ends: ``free`` in view, ``border`` at the picture's edge, ``hidden`` under
    another DLO."""

    xy: tuple[float, float]
    kind: EndpointKind


@dataclass(frozen=True, eq=False)
class Instance:
    """One DLO. Its id is its place in :attr:`Scene.instances` plus 1, and its value in
    :attr:`Scene.labels`.

    ``centerline_xy``: ``(n, 2)`` pixels at equal arc length, end to end; a ring repeats its first
    point. ``score``: probability that it matches one true DLO above IoU 0.5 (``confidence.py``);
    ``reasons``: what makes it unsure.
    """

    centerline_xy: FloatArray
    width_px: float
    length_px: float
    closed: bool
    spline: Spline
    endpoints: tuple[Endpoint, ...]
    score: float
    reasons: tuple[Reason, ...] = ()


@dataclass(frozen=True, eq=False)
class StrandPosition:
    """A place on an instance: its id (from 1) and ``u``, 0 to 1 by arc length along its
    centerline."""

    instance: int
    u: float


@dataclass(frozen=True, eq=False)
class Crossing:
    """One strand over another, or over itself. ``score``: probability that the order is right, 0.5
    (not known) to 1; ``existence``: that two strands cross here."""

    xy: tuple[float, float]
    over: StrandPosition
    under: StrandPosition
    score: float
    existence: float = 1.0


@dataclass(frozen=True, eq=False)
class Scene:
    """The DLOs of one picture.

    ``labels``: ``(H, W)`` uint8, 0 background, else the id of the instance seen there (at crossings
    the upper). ``timings_ms``: wall-clock time of each step. ``features``: what the probabilities
    were computed from, by name (``confidence.py``); not kept for pictures that were worked on at a
    smaller size.
    """

    instances: tuple[Instance, ...]
    crossings: tuple[Crossing, ...]
    labels: ByteArray
    timings_ms: dict[str, float] = field(default_factory=dict)
    features: dict[str, FloatArray] = field(default_factory=dict)

    def at_scale(self, scale: float | FloatArray) -> Scene:
        """The instances and crossings with ``scale`` pixels, one or (x, y), for each; the labels
        stay as they are."""
        size = float(np.mean(scale))
        instances = (
            replace(
                i,
                centerline_xy=at_scale(i.centerline_xy, scale),
                width_px=i.width_px * size,
                length_px=i.length_px * size,
                spline=replace(i.spline, control_xy=at_scale(i.spline.control_xy, scale)),
                endpoints=tuple(replace(e, xy=point_at_scale(e.xy, scale)) for e in i.endpoints),
            )
            for i in self.instances
        )
        crossings = (replace(c, xy=point_at_scale(c.xy, scale)) for c in self.crossings)
        return replace(self, instances=tuple(instances), crossings=tuple(crossings))
