"""Ordered points along one DLO, as a method found them."""

from __future__ import annotations

from dataclasses import dataclass

from models.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Chain:
    """Ordered points ``(n, 2)`` found along one DLO; a closed one does not repeat its first point.

    ``doubt``: minus the logarithm of the probability that its pieces belong together, where a
    method has it.
    """

    xy: FloatArray
    closed: bool
    doubt: float = 0.0
