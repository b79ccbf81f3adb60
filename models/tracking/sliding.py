"""By how much a piece that shows no end has slid along its cable.

Strategy: on a curve, only what is moved across it shows. But a cable moves smoothly and does not stretch: the plainest
such motion that explains what is seen across it also tells what happened along it. The motion of the nodes is a sum of
a few cosines along the cable; their factors follow from least squares, with stiffness and without stretch.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.geometry.arrays import FloatArray
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
_STRETCH = 1.0
"""Weight of each node's stretch against that of a sample."""
_FARTHEST_WIDTHS = 3.0


def slid(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> list[Piece]:
    """The pieces, those that no end pins down moved along the cable by what its motion tells."""
    if cable.closed or all(piece.pinned for piece in pieces):
        return list(pieces)
    factors = _factors(pieces, cable, expected)
    out = []
    for piece in pieces:
        if not piece.pinned:
            basis, tangent, _ = _at(piece, cable, expected)
            along = ((basis @ factors) * tangent).sum(1)
            piece = piece._replace(position=piece.position - float(np.median(along)))
        out.append(piece)
    return out


def _factors(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> FloatArray:
    """(MODES, 2) of the motion from ``expected`` to what is seen."""
    rows, values = [], []
    for piece in pieces:
        inside = (piece.position >= 0) & (piece.position <= cable.length_px)
        piece = piece._replace(xy=piece.xy[inside], position=piece.position[inside])
        basis, tangent, away = _at(piece, cable, expected)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        for direction in (normal, tangent) if piece.pinned else (normal,):
            rows.append(np.hstack([basis * direction[:, :1], basis * direction[:, 1:]]))
            values.append((away * direction).sum(1))
    rows.append(stretch(directions(expected)))
    values.append(np.zeros(NODES))
    matrix, known = np.concatenate(rows), np.concatenate(values)
    system = matrix.T @ matrix + np.diag(precision(cable))
    return np.asarray(np.linalg.solve(system, matrix.T @ known).reshape(2, MODES).T)


def stretch(tangent: FloatArray) -> FloatArray:
    """(NODES, 2 MODES) by what each factor stretches a cable of these tangents (NODES, 2)."""
    rising = -_ORDER * np.sin(np.pi * _ORDER * _NODES_U[:, None])
    return np.asarray(_STRETCH * np.hstack([rising * tangent[:, :1], rising * tangent[:, 1:]]))


def precision(cable: TrackedCable) -> FloatArray:
    """(2 MODES,) how firmly each factor is held to nothing, against the error of a sample."""
    usual = _SURPRISE * cable.width_px * (_UNKNOWN if cable.met < _KNOWN_AFTER else 1.0)
    return np.asarray(np.tile(_NOISE_PX**2 * _INDEPENDENT / usual**2, 2))


def waves(u: FloatArray) -> FloatArray:
    """(n, MODES) the cosines at the places ``u`` (n,), 0 to 1 of the length."""
    return np.asarray(np.cos(np.pi * _ORDER * u[:, None]))


def _at(piece: Piece, cable: TrackedCable, expected: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cosines (n, MODES), tangents (n, 2) and what the piece's points are off (n, 2) where it is on the cable."""
    u = np.clip(piece.position / cable.length_px, 0.0, 1.0)
    tangent = np.stack([np.interp(u, _NODES_U, axis) for axis in directions(expected).T], axis=1)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    away = piece.xy - np.stack([np.interp(u, _NODES_U, axis) for axis in expected.T], axis=1)
    most = _FARTHEST_WIDTHS * cable.width_px
    return waves(u), tangent, np.clip(away, -most, most)
