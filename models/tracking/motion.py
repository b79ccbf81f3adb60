"""Where a cable is expected, and where it is once pieces of it were seen.

Strategy: a cable moves smoothly along its length, so what its nodes in view are off from where they
were expected is fitted by a few cosines; these also move the nodes out of view, and correct the
velocity of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.polylines import point_at
from models.instances.scene import EndpointKind
from models.tracking.course import laid_on
from models.tracking.extent import revised
from models.tracking.nodes import between, middle
from models.tracking.placing import Piece, end_kind, shows_all
from models.tracking.sliding import precision, waves
from models.tracking.state import MOST_SPREAD_WIDTHS, NODES, TrackedCable

_GAIN = 0.6
"""Share of what a prediction was off that corrects the velocity."""
_JUMP_WIDTHS = 3.0
"""A cable that is so far off was taken for somewhere else: that is no motion."""
DAMPING = 0.9
"""Share of its velocity that a node out of view keeps from frame to frame."""
_LENGTH_GAIN, _LENGTH_CHANGE = 0.1, 0.002
"""Share of a measured length that replaces the known one; by which share this grows or shrinks in a
frame, at most."""
_WHOLE = 0.93
"""A cable of which this share is in view counts as seen."""
_SPREAD_WIDTHS, _SPREAD_SPEED = 0.1, 0.3
"""By what a node out of view may be further off every frame: in widths, and as a share of its
speed."""
_ADRIFT_WIDTHS, _MOST_ADRIFT_WIDTHS = 0.25, 12.0
"""By which a cable of which no end is in view may have slid along itself, more every frame; at
most."""
_AT_AN_END = 0.2
"""Share of that where some end is in view that is not the known one: the place of that end would
change, too."""
_KNOWN_PLACE_WIDTHS = 2.0
"""An end that comes into view is known from then on if the cable has slid by less, or has no other
known end."""
_END_WIDTHS = 2.0
_ALONE = 0.5
"""A node counts as alone from such trust on."""
_OF_TANGLED, _OF_SHARED, _OF_UNKNOWN = 0.03, 0.01, 0.003
"""Weight of a node in a tangle, of one whose strand is another cable's by now, and of one that is
supposed to move on as it did, against that of one alone."""
_SLACK_WIDTHS = 0.7
_KNOWN_WIDTHS = 1.5
"""A node that may be further off than this shows nothing."""
_MODES = waves(np.linspace(0, 1, NODES))
_STIFFNESS = np.diag(0.02 * np.arange(6.0) ** 4)


def expected_xy(cable: TrackedCable, frames: float = 1.0) -> FloatArray:
    """(NODES, 2) so many usual frames on."""
    return np.asarray(cable.xy + frames * cable.velocity)


def moved(
    cable: TrackedCable,
    predicted: FloatArray,
    on: FloatArray,
    pieces: Sequence[Piece],
    goes_on: tuple[bool, bool] = (False, False),
    frames: float = 1.0,
    covered: bool = False,
) -> TrackedCable:
    """The cable after ``pieces`` of it were seen, so many usual frames later: it was ``predicted``
    (NODES, 2) by its velocity, and is ``on`` the strands of the picture; ``goes_on`` as of
    :func:`models.tracking.extent.revised`. In a picture where something covers the cables
    (``covered``) nothing is learned of its ends."""
    if not covered:
        cable, predicted, on, pieces = _lengthened(cable, predicted, on, pieces)
    xy, seen, firm, alone = _laid(cable, on, pieces)
    known = cable.spread <= _KNOWN_WIDTHS * cable.width_px
    weight = np.where(
        alone, 1.0, np.where(seen, _OF_TANGLED, np.where(known, _OF_SHARED, _OF_UNKNOWN))
    )
    off = _smooth(np.where((seen | known)[:, None], xy - predicted, 0.0), weight, cable)
    hidden = ~seen[:, None]
    seam = _seam(xy - predicted - off, alone if alone.any() else seen)
    model = predicted + off + seam
    model += _toward(xy - model, cable.width_px) * (seen & ~alone)[:, None]
    xy, course = laid_on(cable, np.where(alone[:, None], xy, model), seen)
    away = middle(np.hypot(off[:, 0], off[:, 1]))
    gain = _GAIN if away < _JUMP_WIDTHS * cable.width_px else 0.0
    velocity = (cable.velocity + gain / frames * off) * np.where(hidden, DAMPING, 1.0)
    after = replace(
        cable,
        xy=xy,
        ends=cable.ends if covered else _ends(cable, pieces),
        length_px=_length(cable, pieces),
        velocity=velocity,
        seen=seen,
        firm=firm,
        course=course,
        spread=wider(cable, seen),
        adrift_px=adrift(cable, pieces),
        state="seen" if seen.mean() >= _WHOLE else "partly_covered",
        missed=0,
        met=cable.met + 1,
    )
    return after if covered else revised(after, pieces, goes_on)


def adrift(cable: TrackedCable, pieces: Sequence[Piece] = ()) -> float:
    """Px by which the places of the cable may have slid along it, after one more frame that showed
    ``pieces`` of it."""
    if any(piece.pinned for piece in pieces):
        return 0.0
    free = any("free" in (end_kind(piece, piece.u0), end_kind(piece, piece.u1)) for piece in pieces)
    more = _ADRIFT_WIDTHS * cable.width_px * (_AT_AN_END if free else 1.0)
    return min(cable.adrift_px + more, _MOST_ADRIFT_WIDTHS * cable.width_px)


def wider(cable: TrackedCable, seen: BoolArray) -> FloatArray:
    """(NODES,) px by which nodes may be elsewhere: nothing where they were ``seen``, else more than
    before."""
    more = _SPREAD_WIDTHS * cable.width_px + _SPREAD_SPEED * np.hypot(*cable.velocity.T)
    return np.where(seen, 0.0, np.minimum(cable.spread + more, MOST_SPREAD_WIDTHS * cable.width_px))


def _laid(
    cable: TrackedCable, expected: FloatArray, pieces: Sequence[Piece]
) -> tuple[FloatArray, BoolArray, FloatArray, BoolArray]:
    """Nodes on the pieces, the first piece before the others; which these are, how firm each is by
    now, and which are where a strand is alone."""
    spacing = cable.length_px / (NODES - 1)
    at = np.linspace(0.0, cable.length_px, NODES)
    xy, seen, firm, alone = (
        expected.copy(),
        np.zeros(NODES, bool),
        cable.firm.copy(),
        np.zeros(NODES, bool),
    )
    for piece in pieces:
        for turn in (-cable.length_px, 0.0, cable.length_px) if cable.closed else (0.0,):
            position = piece.position + turn
            inside = (
                (at > position[0] - 0.5 * spacing) & (at < position[-1] + 0.5 * spacing) & ~seen
            )
            if inside.any():
                xy[inside] = point_at(piece.xy, position, at[inside])
                trust = np.interp(at[inside], position, piece.trust)
                firm[inside] = np.minimum(firm[inside] + trust, 1.0)
                alone[inside] = trust > _ALONE
                seen |= inside
    return xy, seen, firm, alone


def _smooth(off: FloatArray, weight: FloatArray, cable: TrackedCable) -> FloatArray:
    """(NODES, 2) the motion that nodes which are ``off`` with these weights (NODES,) tell; held to
    none where they tell little."""
    weighted = (_MODES * weight[:, None]).T
    prior = np.diag(precision(cable)[: len(_STIFFNESS)]) + _STIFFNESS
    return np.asarray(_MODES @ np.linalg.solve(weighted @ _MODES + prior, weighted @ off))


def _seam(rest: FloatArray, there: BoolArray) -> FloatArray:
    """(NODES, 2) what is left of ``rest`` at the nodes that are ``there``, interpolated between
    them."""
    nodes, known = np.arange(NODES), np.flatnonzero(there)
    if not len(known):
        return np.zeros_like(rest)
    return np.stack([np.interp(nodes, known, axis) for axis in rest[known].T], axis=1)


def _toward(off: FloatArray, width_px: float) -> FloatArray:
    """(NODES, 2) part of ``off`` by which a node in a tangle is drawn to it: within the tangle it
    may be anywhere."""
    far = np.hypot(*off.T)[:, None]
    slack = _SLACK_WIDTHS * width_px
    return np.asarray(off * np.maximum(far - slack, 0.0) / np.maximum(far, 1e-9))


def _ends(cable: TrackedCable, pieces: Sequence[Piece]) -> tuple[EndpointKind, EndpointKind]:
    """An end that was out of view and is seen to be free now is free from here on; not so while
    another end is known better than the places of what is in view: that one tells where this one
    is, once it is back."""
    first, last = cable.ends
    near = _END_WIDTHS * cable.width_px
    if "free" in cable.ends and cable.adrift_px > _KNOWN_PLACE_WIDTHS * cable.width_px:
        return first, last
    for piece in pieces:
        if end_kind(piece, piece.u0) == "free" and piece.position[0] < near:
            first = "free"
        if end_kind(piece, piece.u1) == "free" and piece.position[-1] > cable.length_px - near:
            last = "free"
    return first, last


def _length(cable: TrackedCable, pieces: Sequence[Piece]) -> float:
    """The picture of a cable that is moved grows and shrinks a little: seen from end to end it is
    measured anew, slowly: in a tangle a strand cuts corners, or ends where another one does."""
    whole = next((piece for piece in pieces if shows_all(piece, cable)), None)
    if whole is None or cable.ends != ("free", "free"):
        return cable.length_px
    gain = max(1.0 / (cable.met + 1), _LENGTH_GAIN)
    change = gain * (whole.observed.length_px / cable.length_px - 1.0)
    return cable.length_px * (1.0 + float(np.clip(change, -_LENGTH_CHANGE, _LENGTH_CHANGE)))


def _lengthened(
    cable: TrackedCable, predicted: FloatArray, on: FloatArray, pieces: Sequence[Piece]
) -> tuple[TrackedCable, FloatArray, FloatArray, list[Piece]]:
    """A cable whose ends were out of view is longer than it was known to be: its nodes are laid
    anew."""
    before = after = 0.0
    if not cable.closed and cable.ends[0] != "free":
        before = max(-min(float(p.position[0]) for p in pieces), 0.0)
    if not cable.closed and cable.ends[1] != "free":
        after = max(max(float(p.position[-1]) for p in pieces) - cable.length_px, 0.0)
    if before + after < cable.length_px / NODES:
        return cable, predicted, on, list(pieces)
    length = cable.length_px + before + after
    old = np.linspace(0.0, cable.length_px, NODES) + before
    new = np.linspace(0.0, length, NODES)
    place = (new - before) * ((NODES - 1) / cable.length_px)
    xy, velocity, predicted, on = (
        between(values, place) for values in (cable.xy, cable.velocity, predicted, on)
    )
    spread = np.interp(new, old, cable.spread)
    middle = 0.5 * (old[1:] + old[:-1]), 0.5 * (new[1:] + new[:-1])
    course = np.interp(middle[1], middle[0], cable.course, left=np.nan, right=np.nan)
    firm = np.interp(new, old, cable.firm, left=0.0, right=0.0)
    shifted = [piece._replace(position=piece.position + before) for piece in pieces]
    longer = replace(
        cable,
        xy=xy,
        velocity=velocity,
        spread=spread,
        firm=firm,
        course=course,
        length_px=length,
        start_px=cable.start_px - before,
    )
    return longer, predicted, on, shifted
