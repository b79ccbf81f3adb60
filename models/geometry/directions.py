"""Directions in the plane: arrays of vectors ``(…, 2)``, x then y."""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import FloatArray, IntArray

_NOTHING = 1e-9
"""A shorter vector has no direction: it stays about 0."""
_LANES = np.array([-0.25, 0.0, 0.25])
"""Of a strand's width, aside of its middle."""


def unit(vectors: FloatArray) -> FloatArray:
    """The vectors at length 1."""
    out: FloatArray = (
        vectors / np.maximum(np.hypot(vectors[..., 0], vectors[..., 1]), _NOTHING)[..., None]
    )
    return out


def quarter_turned(directions: FloatArray) -> FloatArray:
    """The directions after a quarter turn from x towards y."""
    return np.stack((-directions[..., 1], directions[..., 0]), axis=-1)


def middle_lanes(normals: FloatArray, width: float) -> FloatArray:
    """``(3, …, 2)`` offsets along ``normals`` that span the middle half of a strand of this width:
    averaged over it, a highlight counts little."""
    return (width * _LANES).reshape(3, *[1] * normals.ndim) * normals


def tangents(line: FloatArray) -> FloatArray:
    """``(n, 2)`` unit directions along a line of ``(n, 2)`` points, ``n >= 2``."""
    steps = np.empty_like(line, dtype=np.float64)
    steps[1:-1] = line[2:] - line[:-2]
    steps[0], steps[-1] = line[1] - line[0], line[-1] - line[-2]
    return unit(steps)


def tangents_of_each(points: FloatArray, owner: IntArray) -> FloatArray:
    """:func:`tangents` of lines one after the other: ``(N, 2)`` for their points ``(N, 2)`` and the
    line ``(N,)`` that each belongs to."""
    place = np.arange(len(points))
    same = owner[1:] == owner[:-1]
    after, before = place + np.append(same, False), place - np.append(False, same)
    return unit(points[after] - points[before])


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """``(…,)`` radians, 0 to pi, between unit vectors."""
    out: FloatArray = np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0))
    return out
