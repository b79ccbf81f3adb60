"""What the reconstruction is given: cameras, and in each picture the centerlines of the DLOs seen
there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.cameras import Camera
from models.geometry.directions import quarter_turned, unit
from models.geometry.polylines import arc_lengths, resample

_SPACING_PX = 1.0
_TANGENT_PX = 4
"""A strand's direction is taken over so many samples to either side: its points are noisy."""


@dataclass(frozen=True, eq=False)
class Strand:
    """One DLO in one picture, resampled about every pixel.

    ``xy`` (n, 2) ideal pixels in order; ``normals`` (n, 2) unit; ``width_px`` (n,) of the DLO
    there; ``known`` (n,) where both of its edges are seen: in between the line is a guess.
    """

    xy: FloatArray
    normals: FloatArray
    width_px: FloatArray
    known: BoolArray

    @property
    def length_px(self) -> float:
        return float(arc_lengths(self.xy)[-1])

    @classmethod
    def through(
        cls, xy: FloatArray, width_px: float | FloatArray, known: BoolArray | None = None
    ) -> Strand:
        """Of at least two different points; ``width_px`` one for all, or one a point; ``known`` all
        by default."""
        lengths = arc_lengths(xy)
        count = max(int(np.ceil(lengths[-1] / _SPACING_PX)) + 1, 3)
        dense = resample(xy, count)
        widths = np.broadcast_to(np.asarray(width_px, np.float64), len(xy))
        places = np.linspace(0, lengths[-1], count)
        along = np.interp(places, lengths, widths)
        sure = np.ones(len(xy)) if known is None else known.astype(np.float64)
        return cls(dense, _normals(dense), along, np.interp(places, lengths, sure) > 0.5)

    def part(self, first: int, past: int) -> Strand:
        """The samples from ``first`` to before ``past``."""
        cut = slice(first, past)
        return Strand(self.xy[cut], self.normals[cut], self.width_px[cut], self.known[cut])

    def turned(self, back: bool) -> Strand:
        """In the other direction if ``back``."""
        return (
            Strand(self.xy[::-1], -self.normals[::-1], self.width_px[::-1], self.known[::-1])
            if back
            else self
        )


@dataclass(frozen=True, eq=False)
class View:
    """A camera and what it sees. ``name`` is what messages call it."""

    camera: Camera
    strands: tuple[Strand, ...]
    name: str

    @cached_property
    def samples(self) -> Samples:
        return Samples.of(self.strands)


@dataclass(frozen=True, eq=False)
class Samples:
    """What is known of all strands of a view in one array each: ``xy`` (m, 2), ``normals`` (m, 2),
    ``width_px`` (m,), ``strand`` (m,) and ``at_end`` (m,), which marks the first and last sample of
    every known stretch."""

    xy: FloatArray
    normals: FloatArray
    width_px: FloatArray
    strand: IntArray
    at_end: BoolArray

    @classmethod
    def of(cls, strands: tuple[Strand, ...], which: IntArray | None = None) -> Samples:
        """Of all strands, or of those whose numbers are ``which``."""
        numbers = np.arange(len(strands)) if which is None else which
        chosen = [strands[k] for k in numbers]
        if not chosen:
            nothing = np.zeros((0, 2))
            return cls(nothing, nothing, np.zeros(0), np.zeros(0, np.int64), np.zeros(0, bool))
        known = np.concatenate([s.known for s in chosen])
        return cls(
            np.concatenate([s.xy for s in chosen])[known],
            np.concatenate([s.normals for s in chosen])[known],
            np.concatenate([s.width_px for s in chosen])[known],
            np.repeat(numbers, [len(s.xy) for s in chosen]).astype(np.int64)[known],
            np.concatenate([_run_ends(s.known) for s in chosen])[known],
        )

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.xy)


def _run_ends(known: BoolArray) -> BoolArray:
    """(n,) the first and the last sample of every known stretch."""
    padded = np.pad(known, 1)
    ends: BoolArray = known & ~(padded[:-2] & padded[2:])
    return ends


def _normals(xy: FloatArray) -> FloatArray:
    index = np.arange(len(xy))
    tangent = (
        xy[np.minimum(index + _TANGENT_PX, len(xy) - 1)] - xy[np.maximum(index - _TANGENT_PX, 0)]
    )
    return quarter_turned(unit(tangent))
