"""Where a cable is expected, and where it is once pieces of it were seen.

Strategy: a cable moves smoothly along its length, so what its nodes in view are off from where they were expected is
fitted by a few cosines; these also move the nodes out of view, and correct the velocity of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.polylines import arc_lengths
from models.instances.scene import EndpointKind
from models.tracking.placing import Piece
from models.tracking.state import NODES, TrackedCable

_GAIN = 0.6
"""Share of what a prediction was off that corrects the velocity."""
_JUMP_WIDTHS = 3.0
"""A cable that is so far off was taken for somewhere else: that is no motion."""
DAMPING = 0.9
"""Share of its velocity that a node out of view keeps from frame to frame."""
_LENGTH_CHANGE = 0.01
"""Share by which the picture of a cable grows or shrinks from one frame to the next, at most."""
_WHOLE = 0.93
"""A cable of which this share is in view counts as seen."""
_SPREAD_WIDTHS, _SPREAD_SPEED, _MOST_SPREAD_WIDTHS = 0.1, 0.3, 12.0
"""By what a node out of view may be further off every frame: in widths, and as a share of its speed; at most."""
_END_WIDTHS = 2.0
_MODES = np.cos(np.pi * np.arange(6) * np.linspace(0, 1, NODES)[:, None])
_STIFFNESS = np.diag(0.02 * np.arange(6.0) ** 4)


def expected_xy(cable: TrackedCable, frames: float = 1.0) -> FloatArray:
    """(NODES, 2) so many usual frames on."""
    return np.asarray(cable.xy + frames * cable.velocity)


def moved(cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece], frames: float = 1.0) -> TrackedCable:
    """The cable after ``pieces`` of it were seen, so many usual frames later."""
    cable, expected, pieces = _lengthened(cable, expected, pieces)
    xy, seen, firm = _laid(cable, expected, pieces)
    off = _smooth(xy - expected, seen)
    hidden = ~seen[:, None]
    nodes, known = np.arange(NODES), np.flatnonzero(seen)
    rest = (xy - expected - off)[known]
    seam = np.stack([np.interp(nodes, known, rest[:, axis]) for axis in (0, 1)], axis=1)
    xy = np.where(hidden, expected + off + seam, xy)
    away = float(np.median(np.hypot(*off.T)))
    gain = _GAIN if away < _JUMP_WIDTHS * cable.width_px else 0.0
    velocity = (cable.velocity + gain / frames * off) * np.where(hidden, DAMPING, 1.0)
    return replace(
        cable,
        xy=xy,
        ends=_ends(cable, pieces),
        length_px=_length(cable, xy, seen),
        velocity=velocity,
        seen=seen,
        firm=firm,
        spread=wider(cable, seen),
        state="seen" if seen.mean() >= _WHOLE else "partly_covered",
        missed=0,
        met=cable.met + 1,
    )


def wider(cable: TrackedCable, seen: BoolArray) -> FloatArray:
    """(NODES,) px by which nodes may be elsewhere: nothing where they were ``seen``, else more than before."""
    more = _SPREAD_WIDTHS * cable.width_px + _SPREAD_SPEED * np.hypot(*cable.velocity.T)
    return np.where(seen, 0.0, np.minimum(cable.spread + more, _MOST_SPREAD_WIDTHS * cable.width_px))


def _laid(
    cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece]
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Nodes on the pieces, the first piece before the others; which these are, and how firm each is by now."""
    spacing = cable.length_px / (NODES - 1)
    at = np.linspace(0.0, cable.length_px, NODES)
    xy, seen, firm = expected.copy(), np.zeros(NODES, bool), cable.firm.copy()
    for piece in pieces:
        for turn in (-cable.length_px, 0.0, cable.length_px) if cable.closed else (0.0,):
            position = piece.position + turn
            inside = (at > position[0] - 0.5 * spacing) & (at < position[-1] + 0.5 * spacing) & ~seen
            if inside.any():
                xy[inside] = np.stack([np.interp(at[inside], position, axis) for axis in piece.xy.T], axis=1)
                firm[inside] = np.minimum(firm[inside] + np.interp(at[inside], position, piece.trust), 1.0)
                seen |= inside
    return xy, seen, firm


def _smooth(off: FloatArray, seen: BoolArray) -> FloatArray:
    """(NODES, 2) fitted to ``off`` of the nodes in view; beyond them it is the flatter the further."""
    if not seen.any():
        return np.zeros_like(off)
    modes = _MODES[seen]
    return np.asarray(_MODES @ np.linalg.solve(modes.T @ modes + _STIFFNESS, modes.T @ off[seen]))


def _ends(cable: TrackedCable, pieces: Sequence[Piece]) -> tuple[EndpointKind, EndpointKind]:
    """An end that was out of view and is seen to be free now is free from here on."""
    first, last = cable.ends
    near = _END_WIDTHS * cable.width_px
    for piece in pieces:
        if _end(piece, piece.u0) == "free" and piece.position[0] < near:
            first = "free"
        if _end(piece, piece.u1) == "free" and piece.position[-1] > cable.length_px - near:
            last = "free"
    return first, last


def _end(piece: Piece, u: float) -> EndpointKind:
    """What is at the place ``u`` of the piece's observation."""
    if u < 0.01:
        return piece.observed.ends[0]
    return piece.observed.ends[1] if u > 0.99 else "hidden"


def _length(cable: TrackedCable, xy: FloatArray, seen: BoolArray) -> float:
    """The picture of a cable that is moved grows and shrinks a little: seen from end to end it is measured anew."""
    if seen.mean() < _WHOLE or cable.ends != ("free", "free"):
        return cable.length_px
    change = float(arc_lengths(xy)[-1]) / cable.length_px
    return cable.length_px * float(np.clip(change, 1 - _LENGTH_CHANGE, 1 + _LENGTH_CHANGE))


def _lengthened(
    cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece]
) -> tuple[TrackedCable, FloatArray, list[Piece]]:
    """A cable whose ends were out of view is longer than it was known to be: its nodes are laid anew."""
    before = after = 0.0
    if not cable.closed and cable.ends[0] != "free":
        before = max(-min(float(p.position[0]) for p in pieces), 0.0)
    if not cable.closed and cable.ends[1] != "free":
        after = max(max(float(p.position[-1]) for p in pieces) - cable.length_px, 0.0)
    if before + after < cable.length_px / NODES:
        return cable, expected, list(pieces)
    length = cable.length_px + before + after
    old = np.linspace(0.0, cable.length_px, NODES) + before
    new = np.linspace(0.0, length, NODES)
    xy, velocity, expected = (
        np.stack([np.interp(new, old, values[:, axis]) for axis in (0, 1)], axis=1)
        for values in (cable.xy, cable.velocity, expected)
    )
    spread = np.interp(new, old, cable.spread)
    firm = np.interp(new, old, cable.firm, left=0.0, right=0.0)
    shifted = [piece._replace(position=piece.position + before) for piece in pieces]
    longer = replace(
        cable, xy=xy, velocity=velocity, spread=spread, firm=firm, length_px=length, start_px=cable.start_px - before
    )
    return longer, expected, shifted
