"""Where a cable is expected, and where it is once pieces of it were seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.instances.scene import EndpointKind
from models.tracking.assignment import Piece
from models.tracking.state import NODES, TrackedCable

_DAMPING = 0.7
"""Share of the velocity that is expected to go on; while a cable is not seen, this share again every frame."""
_INERTIA = 0.5
_LENGTH_CHANGE = 0.01
"""Share by which the picture of a cable grows or shrinks from one frame to the next, at most."""
_WHOLE = 0.93
"""A cable of which this share is in view counts as seen."""


def expected_xy(cable: TrackedCable) -> FloatArray:
    """(NODES, 2) one frame on."""
    return np.asarray(cable.xy + _DAMPING ** (cable.missed + 1) * cable.velocity)


def moved(cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece]) -> TrackedCable:
    """The cable after ``pieces`` of it were seen: nodes in view take the pieces' places, the others move as their
    nearest neighbors in view did."""
    cable, expected, pieces = _lengthened(cable, expected, pieces)
    position = np.linspace(0.0, cable.length_px, NODES)
    xy, seen = expected.copy(), np.zeros(NODES, bool)
    for observed, alignment in pieces:
        points = observed.xy[::-1] if alignment.reverse else observed.xy
        lengths = arc_lengths(points)
        share = (position - alignment.start) / max(alignment.stop - alignment.start, 1e-9)
        inside = (share >= -0.01) & (share <= 1.01) & ~seen
        xy[inside] = point_at(points, lengths, np.clip(share[inside], 0, 1) * lengths[-1])
        seen |= inside
    if seen.any():
        xy = _filled(xy, expected, seen)
    velocity = _INERTIA * cable.velocity + (1 - _INERTIA) * (xy - cable.xy)
    return replace(
        cable,
        xy=xy,
        ends=_ends(cable, pieces),
        length_px=_length(cable, xy, seen),
        velocity=np.where(seen[:, None], velocity, _DAMPING * velocity),
        seen=seen,
        state="seen" if seen.mean() >= _WHOLE else "partly_covered",
        missed=0,
    )


def _ends(cable: TrackedCable, pieces: Sequence[Piece]) -> tuple[EndpointKind, EndpointKind]:
    """An end that was out of view and is seen to be free now is free from here on."""
    first, last = cable.ends
    for observed, at in pieces:
        ends = observed.ends[::-1] if at.reverse else observed.ends
        if ends[0] == "free" and at.start < 0.05 * cable.length_px:
            first = "free"
        if ends[1] == "free" and at.stop > 0.95 * cable.length_px:
            last = "free"
    return first, last


def _length(cable: TrackedCable, xy: FloatArray, seen: BoolArray) -> float:
    """The picture of a cable that is moved grows and shrinks a little: what is wholly seen is measured anew."""
    if seen.mean() < _WHOLE:
        return cable.length_px
    change = float(arc_lengths(xy)[-1]) / cable.length_px
    return cable.length_px * float(np.clip(change, 1 - _LENGTH_CHANGE, 1 + _LENGTH_CHANGE))


def _filled(xy: FloatArray, expected: FloatArray, seen: BoolArray) -> FloatArray:
    """Nodes out of view are shifted by what the nodes in view on either side were off."""
    nodes, known = np.arange(NODES), np.flatnonzero(seen)
    off = (xy - expected)[known]
    shift = np.stack([np.interp(nodes, known, off[:, axis]) for axis in (0, 1)], axis=1)
    return np.asarray(np.where(seen[:, None], xy, expected + shift))


def _lengthened(
    cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece]
) -> tuple[TrackedCable, FloatArray, list[Piece]]:
    """A cable whose ends were out of view is longer than it was known to be: its nodes are laid anew."""
    before = max(-min(p.alignment.start for p in pieces), 0.0) if cable.ends[0] != "free" else 0.0
    after = max(max(p.alignment.stop for p in pieces) - cable.length_px, 0.0) if cable.ends[1] != "free" else 0.0
    if before + after < cable.length_px / NODES:
        return cable, expected, list(pieces)
    length = cable.length_px + before + after
    old = np.linspace(0.0, cable.length_px, NODES) + before
    new = np.linspace(0.0, length, NODES)
    xy, velocity, expected = (
        np.stack([np.interp(new, old, values[:, axis]) for axis in (0, 1)], axis=1)
        for values in (cable.xy, cable.velocity, expected)
    )
    shifted = [
        Piece(p.observed, p.alignment._replace(start=p.alignment.start + before, stop=p.alignment.stop + before))
        for p in pieces
    ]
    return replace(cable, xy=xy, velocity=velocity, length_px=length), expected, shifted
