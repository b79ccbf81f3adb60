"""Runs that cannot all be of one cable: two of them at one place of it, or further apart than it is
long between."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from models.tracking.placing import Piece
from models.tracking.state import TrackedCable

_OVERLAP = 0.3
"""Pieces of one cable overlap by less than this share of the shorter one."""
_ROOM_WIDTHS = 4.0
"""By which the end of one piece and the beginning of the next one may be further apart."""


def contradicting(
    pieces: dict[int, Piece], cable: TrackedCable, gains: Mapping[int, float]
) -> list[int]:
    """Keys of the pieces that cannot be of ``cable`` beside the others, of higher ``gains``."""
    order = sorted(pieces, key=lambda k: -gains[k])
    kept: dict[int, Piece] = {}
    out = []
    for k in order:
        if all(
            _shared(pieces[k], other) < _OVERLAP * pieces[k].length_px for other in kept.values()
        ):
            kept[k] = pieces[k]
        else:
            out.append(k)
    return out if cable.closed else out + _loose(kept, cable, gains)


def _loose(pieces: dict[int, Piece], cable: TrackedCable, gains: Mapping[int, float]) -> list[int]:
    """Those that do not hang together with the likeliest stretch."""
    order = sorted(pieces, key=lambda k: float(pieces[k].position[0]))
    groups = [[order[0]]]
    for a, b in pairwise(order):
        if _jumps(pieces[a], pieces[b], cable):
            groups.append([])
        groups[-1].append(b)
    groups.sort(key=lambda group: sum(gains[k] for k in group))
    return [k for group in groups[:-1] for k in group]


def _jumps(a: Piece, b: Piece, cable: TrackedCable) -> bool:
    between = max(float(b.position[0] - a.position[-1]), 0.0)
    return float(np.hypot(*(b.xy[0] - a.xy[-1]))) > between + _ROOM_WIDTHS * cable.width_px


def _shared(a: Piece, b: Piece) -> float:
    return float(min(a.position[-1], b.position[-1]) - max(a.position[0], b.position[0]))
