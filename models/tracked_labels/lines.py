"""Reading the corrector's output: a line of column probabilities a crop (thesis 2.5.3).

The thesis takes the column of the highest value. The expectation over the columns around it is
finer than a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray, IntArray
from models.tracked_labels.crops import MIDDLE, SIZE

_WIDTH_SPREAD = 0.25
"""Of the logarithm of a width: the network's error and that of the thickness that a person
gives."""
_REACH = 4
"""Columns to either side of the peak that share in the expectation."""


class LineReading(NamedTuple):
    """(n,) ``offsets`` of the centerline from the crop's middle and ``widths`` of the DLO, both in
    pixels of the crop; ``trust`` 0 to 1, the probability that is around the peak."""

    offsets: FloatArray
    widths: FloatArray
    trust: FloatArray

    def take(self, rows: IntArray | slice) -> LineReading:
        """Those of the given numbers."""
        return LineReading(self.offsets[rows], self.widths[rows], self.trust[rows])


def weighed(
    probabilities: Float32Array, widths: Float32Array, believed: FloatArray, spread_px: float
) -> FloatArray:
    """(n, c) log evidence of every column: the network's probability, weighed with how far the
    column is from the middle (standard deviation ``spread_px``) and how well its width fits the
    ``believed`` one (n,), crop pixels."""
    columns = probabilities.shape[1]
    away = np.arange(columns) - (columns - 1) / 2
    misfit = np.log(np.maximum(widths, 1.0) / believed[:, None])
    out: FloatArray = (
        np.log(np.maximum(probabilities, 1e-5))
        - away**2 / (2 * spread_px**2)
        - misfit**2 / (2 * _WIDTH_SPREAD**2)
    )
    return out


def side_by_side(lines: Sequence[Float32Array], step: int) -> Float32Array:
    """(n, SIZE + (k - 1) · step) of ``k`` lines (n, SIZE) of crops taken ``step`` columns apart,
    from left to right: each column from the crop whose middle is nearest."""
    total = SIZE + (len(lines) - 1) * step
    columns = np.arange(total)
    nearest = np.rint((columns - MIDDLE) / step).clip(0, len(lines) - 1).astype(int)
    out: Float32Array = np.stack(lines)[nearest, :, columns - nearest * step].T
    return out


def read_lines(probabilities: Float32Array, widths: Float32Array) -> LineReading:
    """At the highest of (n, c) column probabilities; ``widths`` (n, c) as the network puts them
    out."""
    return read_lines_at(probabilities, widths, probabilities.argmax(1))


def read_lines_at(
    probabilities: Float32Array, widths: Float32Array, peaks: IntArray
) -> LineReading:
    """The same around the given columns (n,)."""
    window = peaks[:, None] + np.arange(-_REACH, _REACH + 1)
    columns = probabilities.shape[1]
    inside = (window >= 0) & (window < columns)
    clipped = window.clip(0, columns - 1)
    rows = np.arange(len(peaks))[:, None]
    weight = np.where(inside, probabilities[rows, clipped].astype(np.float64), 0.0)
    total = weight.sum(1)
    safe = np.maximum(total, 1e-12)
    return LineReading(
        np.where(total > 1e-12, (weight * window).sum(1) / safe, peaks) - (columns - 1) / 2,
        np.where(
            total > 1e-12, (weight * widths[rows, clipped]).sum(1) / safe, widths[rows[:, 0], peaks]
        ),
        np.minimum(total, 1.0),
    )
