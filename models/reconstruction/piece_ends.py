"""The ends of pieces of strands: where each is, which way it points, and how deep it is.

Symbols: P pieces, E = 2 P ends; end ``2 p`` is the first sample of piece ``p``, ``2 p + 1`` its
last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import FloatArray, IntArray
from models.reconstruction.matching import MatchParams, match, steepness
from models.reconstruction.views import Strand, View

_LOOK_PX = 40
"""So much of a piece gives its direction; twice as much its depth."""
_CURVED_FROM_PX = 20
_SAMPLE_PX = 5.0
_DEPTH_PX = 0.7
"""What a disparity is off by where strands run straight across the epipolar lines."""
_LEAST_STEEP = 0.02
_SAME_PIECE_PX = 6.0
"""Disparities of a piece this far from its median were matched to something else."""
_SLOPE = 0.15
"""Standard deviation of the change of disparity along a DLO, pixels a pixel."""


@dataclass(frozen=True, eq=False)
class PieceEnds:
    """``tip`` (E, 2) ideal pixels; ``outward`` (E, 2) unit direction out of the piece;
    ``disparity`` (E,) pixels against the farthest other view, ``slope`` (E,) its change by pixel
    outward; ``sigma``, ``slope_sigma`` (E,) their standard deviations, infinite where no other view
    shows the piece."""

    tip: FloatArray
    outward: FloatArray
    disparity: FloatArray
    slope: FloatArray
    sigma: FloatArray
    slope_sigma: FloatArray


def piece_ends(view: View, others: list[View], params: MatchParams) -> PieceEnds:
    """Of all strands of ``view``, each of them matched against ``others`` by itself."""
    rows = [row for strand in view.strands for row in _both_ends(view, strand, others, params)]
    return PieceEnds(*(np.array(column) for column in zip(*rows, strict=True)))


_Row = tuple[FloatArray, FloatArray, float, float, float, float]


def _both_ends(view: View, strand: Strand, others: list[View], params: MatchParams) -> list[_Row]:
    last = len(strand.xy) - 1
    index = np.unique(np.linspace(0, last, int(np.clip(last / _SAMPLE_PX, 4, 60))).astype(np.int64))
    disparity, steep = np.full(len(index), np.nan), np.zeros(len(index))
    if others:
        base = max(
            float(np.linalg.norm(other.camera.center - view.camera.center)) for other in others
        )
        disparity = view.camera.focal_px * base / match(view, strand, index, others, params).depth
        steep = steepness(strand, index, view.camera, [other.camera for other in others])
    ends = []
    for line, at, values, steepest in (
        (strand.xy, index, disparity, steep[0]),
        (strand.xy[::-1], last - index[::-1], disparity[::-1], steep[-1]),
    ):
        value, slope, sigma, slope_sigma = _trend(at, values)
        sigma = float(np.hypot(sigma, _DEPTH_PX / max(steepest, _LEAST_STEEP)))
        ends.append((*_direction(line), value, slope, sigma, slope_sigma))
    return ends


def _direction(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tip and outward direction of a line that begins there: of a parabola through its first
    samples."""
    part = line[:_LOOK_PX]
    fit = np.polyfit(np.arange(len(part)), part, 2 if len(part) >= _CURVED_FROM_PX else 1)
    return fit[-1], -fit[-2] / np.hypot(*fit[-2])


def _trend(at: IntArray, values: FloatArray) -> tuple[float, float, float, float]:
    """Value at the tip, slope outward, and the standard deviations of both, of ``values`` (n,)
    ``at`` (n,) pixels from it."""
    near = (at <= 2 * _LOOK_PX) & np.isfinite(values)
    near[near] = (
        np.abs(values[near] - np.median(values[near])) < _SAME_PIECE_PX if near.any() else False
    )
    if near.sum() < 3:
        return 0.0, 0.0, np.inf, _SLOPE
    matrix = np.stack([np.ones(int(near.sum())), at[near]], axis=1)
    covariance = np.linalg.inv(matrix.T @ matrix + np.diag([0.0, 1 / _SLOPE**2]))
    value, inward = covariance @ (matrix.T @ values[near])
    noise = np.sqrt(np.mean((values[near] - matrix @ [value, inward]) ** 2))
    sigma, slope_sigma = noise * np.sqrt(np.diag(covariance))
    return float(value), float(-inward), float(sigma), float(slope_sigma)
