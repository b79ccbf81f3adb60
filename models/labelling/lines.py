"""Reading the corrector's output: a line of column probabilities a crop (thesis 2.5.3).

The thesis takes the column of the highest value. The expectation over the columns around it is finer than a pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray, IntArray
from models.labelling.crops import MIDDLE, SIZE

_WIDTH_SPREAD = 0.25
"""Of the logarithm of a width: the network's error and that of the thickness that a person gives."""
_REACH = 4
"""Columns to either side of the peak that share in the expectation."""


class LineReading(NamedTuple):
    """(n,) ``offsets`` of the centerline from the crop's middle and ``widths`` of the DLO, both in pixels of the crop;
    ``trust`` 0 to 1, the probability that lies around the peak."""

    offsets: FloatArray
    widths: FloatArray
    trust: FloatArray


def weighed(probabilities: Float32Array, widths: Float32Array, believed: FloatArray, spread_px: float) -> FloatArray:
    """(n, SIZE) log evidence of every column: the network's probability, weighed with how far the column is from the
    middle (standard deviation ``spread_px``) and how well its width fits the ``believed`` one (n,), crop pixels."""
    away = np.arange(SIZE) - MIDDLE
    misfit = np.log(np.maximum(widths, 1.0) / believed[:, None])
    out: FloatArray = (
        np.log(np.maximum(probabilities, 1e-5)) - away**2 / (2 * spread_px**2) - misfit**2 / (2 * _WIDTH_SPREAD**2)
    )
    return out


def read_lines(probabilities: Float32Array, widths: Float32Array) -> LineReading:
    """At the highest of (n, SIZE) column probabilities; ``widths`` (n, SIZE) as the network puts them out."""
    return read_lines_at(probabilities, widths, probabilities.argmax(1))


def read_lines_at(probabilities: Float32Array, widths: Float32Array, peaks: IntArray) -> LineReading:
    """The same around the given columns (n,)."""
    window = peaks[:, None] + np.arange(-_REACH, _REACH + 1)
    inside = (window >= 0) & (window < SIZE)
    clipped = window.clip(0, SIZE - 1)
    rows = np.arange(len(peaks))[:, None]
    weight = np.where(inside, probabilities[rows, clipped].astype(np.float64), 0.0)
    total = weight.sum(1)
    safe = np.maximum(total, 1e-12)
    return LineReading(
        np.where(total > 1e-12, (weight * window).sum(1) / safe, peaks) - MIDDLE,
        np.where(total > 1e-12, (weight * widths[rows, clipped]).sum(1) / safe, widths[rows[:, 0], peaks]),
        np.minimum(total, 1.0),
    )
