"""What is known of the cables of a sequence of pictures, between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.instances.scene import EndpointKind

NODES = 48
"""Points of a tracked cable at equal arc length: node k stays the same place on the cable."""

CableState = Literal["seen", "partly_covered", "lost", "new"]


@dataclass(frozen=True, eq=False)
class Observation:
    """One cable as a single picture shows it, or the part of one between two crossings. ``xy`` (n, 2) px; ``color``
    (3,) CIE Lab along its middle, or None; ``number`` is its id in the picture's scene, ``span`` the share of that
    instance's length."""

    number: int
    xy: FloatArray
    length_px: float
    width_px: float
    ends: tuple[EndpointKind, EndpointKind]
    closed: bool
    score: float
    color: FloatArray | None = None
    span: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class TrackedCable:
    """``xy`` (NODES, 2) px where it is now, or is supposed to be; ``velocity`` (NODES, 2) px a frame; ``seen``
    (NODES,) whether a node is in view; ``certainty`` probability that this is the cable which first had the id;
    ``missed`` frames since it was last seen; ``number`` of the observation that it is, 0 when it is not seen."""

    id: int
    xy: FloatArray
    velocity: FloatArray
    seen: BoolArray
    length_px: float
    width_px: float
    ends: tuple[EndpointKind, EndpointKind]
    closed: bool
    state: CableState
    certainty: float
    score: float
    missed: int = 0
    number: int = 0
    color: FloatArray | None = None

    @property
    def covered(self) -> list[tuple[float, float]]:
        """Shares (u0, u1) of its length that are out of view."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], ~self.seen, [False]]).astype(int)))
        u = np.linspace(0.0, 1.0, NODES)
        return [(float(u[a]), float(u[b - 1])) for a, b in edges.reshape(-1, 2)]


class CrossingOrder(NamedTuple):
    """``over`` lies on ``under``, both cable ids, at ``over_u`` and ``under_u`` of their lengths; ``evidence`` log odds
    that the order is right, gathered over the frames."""

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


@dataclass(frozen=True, eq=False)
class Track:
    """All cables met so far that may come back; ``next_id`` goes to the next new one."""

    frame: int = 0
    cables: tuple[TrackedCable, ...] = ()
    crossings: tuple[CrossingOrder, ...] = ()
    next_id: int = 1
