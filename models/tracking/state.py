"""What is known of the cables of a sequence of pictures, between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.components import runs
from models.instances.scene import EndpointKind

NODES = 48
"""Points of a tracked cable at equal arc length: node k stays the same place on the cable."""

MOST_SPREAD_WIDTHS = 12.0
"""Widths by which a node out of view may be off, at most."""

CableState = Literal["seen", "partly_covered", "lost", "new"]


@dataclass(frozen=True, eq=False)
class Observation:
    """One cable as a single picture shows it. ``xy`` (n, 2) px; ``color`` (3,) CIE Lab along its
    middle, or None, ``mottled`` by how much it varies there; ``number`` is its id in the picture's
    scene; ``crossings`` where it crosses another strand, 0 to 1 of its length; ``bridged`` (n,)
    whether a point is on a gap that was bridged: there is no foreground; ``thick`` (n,) whether the
    foreground is too wide there for one strand; ``leaves`` (n,) whether it is at the picture's
    border."""

    number: int
    xy: FloatArray
    length_px: float
    width_px: float
    ends: tuple[EndpointKind, EndpointKind]
    closed: bool
    score: float
    color: FloatArray | None = None
    mottled: float = 0.0
    crossings: tuple[float, ...] = ()
    bridged: BoolArray | None = None
    thick: BoolArray | None = None
    leaves: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class TrackedCable:
    """``xy`` (NODES, 2) px where it is now, or is supposed to be; ``velocity`` (NODES, 2) px a
    frame; ``seen`` (NODES,) whether a node is in view; ``firm`` (NODES,) 0 to 1, how surely the
    cable goes on there: it was seen alone, or in short tangles often; ``spread`` (NODES,) px by
    which a node may be elsewhere; ``course`` (NODES - 1,) rad, its direction between the nodes as
    it was seen over many frames; ``certainty`` probability that this is the cable which first had
    the id; ``likely`` the same of the last frame alone: a doubt that goes on counts once;
    ``missed`` frames since it was last seen; ``met`` frames in which it was seen; ``adrift_px`` by
    how much its places may have slid along it since an end of it was seen; ``joined`` how many
    frames more than not joined it to a cable that is known to be another one; ``doubted`` how many
    frames in a row showed its first and its last end elsewhere, less those that confirmed it
    before; ``number`` of the observation that most of it is on, 0 when it is not seen; ``start_px``
    arc length of the first node from where the cable began when it was first met: below 0 once more
    of it came into view there, so that a place on the cable keeps its arc length."""

    id: int
    xy: FloatArray
    velocity: FloatArray
    seen: BoolArray
    firm: FloatArray
    spread: FloatArray
    course: FloatArray
    length_px: float
    width_px: float
    ends: tuple[EndpointKind, EndpointKind]
    closed: bool
    state: CableState
    certainty: float
    score: float
    likely: float = 1.0
    missed: int = 0
    met: int = 1
    adrift_px: float = 0.0
    joined: int = 0
    doubted: tuple[int, int] = (0, 0)
    number: int = 0
    color: FloatArray | None = None
    start_px: float = 0.0

    @property
    def covered(self) -> list[tuple[float, float]]:
        """Shares (u0, u1) of its length that are out of view."""
        u = np.linspace(0.0, 1.0, NODES)
        return [(float(u[a]), float(u[b - 1])) for a, b in runs(~self.seen)]


class CrossingOrder(NamedTuple):
    """``over`` is on ``under``, both cable ids, at ``over_u`` and ``under_u`` of their lengths;
    ``evidence`` log odds that the order is right, gathered over the frames."""

    over: int
    under: int
    over_u: float
    under_u: float
    xy: tuple[float, float]
    evidence: float

    @property
    def score(self) -> float:
        """Probability that the order is right."""
        return float(1.0 / (1.0 + np.exp(-self.evidence)))


@dataclass(frozen=True)
class Cover:
    """``shown_px``: length of all strands in view, the most of late; ``covered``: something is
    over a part of them now."""

    shown_px: float = 0.0
    covered: bool = False


@dataclass(frozen=True, eq=False)
class Track:
    """All cables met so far that may come back; ``next_id`` goes to the next new one. ``time_s`` of
    the last frame and ``step_s``, the usual time between two, where times are known; ``cover``:
    whether something is over them."""

    frame: int = 0
    cables: tuple[TrackedCable, ...] = ()
    crossings: tuple[CrossingOrder, ...] = ()
    next_id: int = 1
    time_s: float | None = None
    step_s: float | None = None
    cover: Cover = Cover()
