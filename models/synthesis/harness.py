"""Synthetic harnesses with their true topology (thesis 6.5.1), and harder than there: what one
is and what it may be like; :mod:`models.synthesis.harness_growth` makes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from models.geometry.arrays import FloatArray
from models.synthesis.harness_curves import (
    Meeting,
)

FREE = -1
"""In place of a branch-point's index: the section ends there."""
Fork = Literal["lanes", "tee", "fork"]


@dataclass(frozen=True)
class HarnessParams:
    """``size`` (height, width) px; ``branch_points`` and ``cables`` (plain ones besides) as bounds;
    ``harnesses`` in view; ``width_share`` bounds of the trunk's width over the picture's width;
    ``cycle_share`` how often a section leaves a bundle and comes back; ``crossings`` bounds on
    their number."""

    size: tuple[int, int] = (480, 640)
    branch_points: tuple[int, int] = (0, 8)
    harnesses: tuple[int, int] = (1, 2)
    cables: tuple[int, int] = (0, 2)
    width_share: tuple[float, float] = (0.012, 0.055)
    cycle_share: float = 0.2
    crossings: tuple[int, int] = (0, 8)


@dataclass(frozen=True, eq=False)
class TrueSection:
    """``xy``: ``(m, 2)``; ``width`` px; ``ends``: branch-point indices, or :data:`FREE`."""

    xy: FloatArray
    width: float
    ends: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Harness:
    """``branch_xy``: ``(B, 2)``; crossings with ``a`` and ``b`` as section indices; ``a_over``:
    ``(C,)`` bool."""

    size: tuple[int, int]
    sections: tuple[TrueSection, ...]
    branch_xy: FloatArray
    crossings: tuple[Meeting, ...]
    a_over: tuple[bool, ...]
