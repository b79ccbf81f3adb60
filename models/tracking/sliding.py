"""By how much a piece that shows no end has slid along its cable.

Strategy: on a curve, only what is moved across it shows. But a cable moves smoothly and does not
stretch: the plainest such motion that explains what is seen across it also shows what happened
along it. The motion of the nodes is a sum of a few cosines along the cable; their factors follow
from least squares, with stiffness and without stretch. What is seen in a tangle may be another
cable's, and counts little.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.tracking.nodes import between, middle
from models.tracking.ownership import directions
from models.tracking.placing import Piece
from models.tracking.state import NODES, TrackedCable

MODES = 6
_ORDER = np.arange(MODES)
_NODES_U = np.linspace(0.0, 1.0, NODES)
_SURPRISE = 0.15 * np.array([1.0, 1.0, 0.8, 0.5, 0.3, 0.2])
"""Widths by which each cosine's part of the motion usually differs from what was expected …"""
_UNKNOWN, _KNOWN_AFTER = 8.0, 4
"""… and so many times that in the first frames, when the velocity is not known yet."""
_NOISE_PX, _INDEPENDENT = 0.7, 4.0
"""Of a sample; so many neighboring ones err alike."""
_OF_TANGLED = 0.1
"""Weight of a sample in a tangle against that of one of a strand that is alone."""
_STRETCH = 1.0
"""Weight of each node's stretch against that of a sample."""
_FARTHEST_WIDTHS = 3.0
_RISING = -_STRETCH * _ORDER * np.sin(np.pi * _ORDER * _NODES_U[:, None])
"""(NODES, MODES) of each cosine, by what it stretches along a direction."""


class _Points(NamedTuple):
    """N points of all pieces: ``of`` (N,) index of the piece, ``pinned`` (N,), ``weight`` (N,);
    ``basis`` (N, MODES) cosines, ``tangent`` (N, 2), and what they are off the expected cable,
    ``away`` (N, 2) px."""

    of: IntArray
    pinned: BoolArray
    weight: FloatArray
    basis: FloatArray
    tangent: FloatArray
    away: FloatArray


def slid(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> list[Piece]:
    """The pieces, those that no end pins down moved along the cable by what its motion shows."""
    if cable.closed or all(piece.pinned for piece in pieces):
        return list(pieces)
    points = _points(pieces, cable, expected)
    along = ((points.basis @ _factors(points, cable, expected)) * points.tangent).sum(1)
    return [
        piece
        if piece.pinned
        else piece._replace(position=piece.position - middle(along[points.of == k]))
        for k, piece in enumerate(pieces)
    ]


def trusted(piece: Piece) -> FloatArray:
    """(n,) weight of each point of a piece."""
    return np.where(piece.trust >= 1, 1.0, _OF_TANGLED)


def _points(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> _Points:
    counts = [len(piece.position) for piece in pieces]
    position = np.concatenate([piece.position for piece in pieces])
    xy = np.concatenate([piece.xy for piece in pieces])
    weight = np.concatenate([trusted(piece) for piece in pieces])
    node = position * ((NODES - 1) / cable.length_px)
    tangent = between(directions(expected), node)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    most = _FARTHEST_WIDTHS * cable.width_px
    return _Points(
        of=np.repeat(np.arange(len(pieces)), counts),
        pinned=np.repeat([piece.pinned for piece in pieces], counts),
        weight=weight * ((position >= 0) & (position <= cable.length_px)),
        basis=waves(np.clip(position / cable.length_px, 0.0, 1.0)),
        tangent=tangent,
        away=np.clip(xy - between(expected, node), -most, most),
    )


def _factors(points: _Points, cable: TrackedCable, expected: FloatArray) -> FloatArray:
    """(MODES, 2) of the motion from ``expected`` to what is seen."""
    normal = np.column_stack([-points.tangent[:, 1], points.tangent[:, 0]])
    rows = stretch(directions(expected))
    system, known = rows.T @ rows + np.diag(precision(cable)), np.zeros(2 * MODES)
    for direction, weight in (
        (normal, points.weight),
        (points.tangent, points.weight * points.pinned),
    ):
        matrix = np.hstack([points.basis * direction[:, :1], points.basis * direction[:, 1:]])
        weighted = (matrix * weight[:, None]).T
        system += weighted @ matrix
        known += weighted @ (points.away * direction).sum(1)
    return np.asarray(np.linalg.solve(system, known).reshape(2, MODES).T)


def stretch(tangent: FloatArray) -> FloatArray:
    """(..., NODES, 2 MODES) by what each factor stretches cables of these tangents (..., NODES,
    2)."""
    return np.asarray(
        np.concatenate([_RISING * tangent[..., :1], _RISING * tangent[..., 1:]], axis=-1)
    )


def precision(cable: TrackedCable) -> FloatArray:
    """(2 MODES,) how firmly each factor is held to nothing, against the error of a sample."""
    usual = _SURPRISE * cable.width_px * (_UNKNOWN if cable.met < _KNOWN_AFTER else 1.0)
    return np.asarray(np.tile(_NOISE_PX**2 * _INDEPENDENT / usual**2, 2))


def waves(u: FloatArray) -> FloatArray:
    """(n, MODES) the cosines at the places ``u`` (n,), 0 to 1 of the length."""
    return np.asarray(np.cos(np.pi * _ORDER * u[:, None]))
