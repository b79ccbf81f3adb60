"""The course of a cable, its direction along it: what a place is recognised by, and how a tail out
of view goes on.

Strategy: a cable that is moved turns and bends smoothly: what is added to its direction is a sum of
a few cosines along it, the smaller the shorter their waves. The rest of its course stays. So the
course seen over many frames shows how far a piece that shows no end has slid along the cable,
without a sum of errors from frame to frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.tracking.nodes import between
from models.tracking.placing import Piece
from models.tracking.sliding import MODES, trusted, waves
from models.tracking.state import NODES, TrackedCable

_BENDS_RAD = 1.2 / np.maximum(np.arange(MODES), 0.1) ** 2
"""Standard deviation of what each cosine adds to the direction; a turn of the whole is free."""
_MIDDLES_U = (np.arange(NODES - 1) + 0.5) / (NODES - 1)
_BASIS = waves(_MIDDLES_U)
_NOISE_RAD, _INDEPENDENT = 0.06, 3.0
"""Of a direction between two samples; so many neighboring ones err alike."""
_SLIDE_WIDTHS, _OF_ADRIFT = 0.1, 0.15
"""By which the place that the motion shows is off, usually: in widths, and as a share of how far
the cable may have slid since an end of it was seen."""
_MOST_SLIDE_WIDTHS, _ROUNDS = 3.0, 3
_LEARNED = 0.03
"""Share of a new course that replaces the one remembered, in a frame."""
_LEAST_SAMPLES = 6
_OF_HIDDEN = 0.03
"""Weight of the direction that a place out of view is supposed to have, against one in view."""
_FORGOTTEN_WIDTHS = 4.0
"""Once a place may be so far from where it is supposed to be, half the weight of its direction is
gone."""
_PULL = 0.15
"""Share of the way from where its velocity brings a tail out of view to where its course has it, in
a frame."""


def course_of(xy: FloatArray) -> FloatArray:
    """(n - 1,) directions between points (n, 2), rad, without jumps."""
    steps = xy[1:] - xy[:-1]
    course = np.arctan2(steps[:, 1], steps[:, 0])
    turns = course[1:] - course[:-1]
    course[1:] = course[0] + np.cumsum(turns - 2 * np.pi * np.rint(turns / (2 * np.pi)))
    return course


class _Steps(NamedTuple):
    """Between each two neighboring points of all pieces: the ``position`` (N,) px along the cable,
    the ``direction`` (N,) rad, whether it is ``pinned`` (N,), and its ``weight`` (N,)."""

    position: FloatArray
    direction: FloatArray
    pinned: BoolArray
    weight: FloatArray


def recognised(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> list[Piece]:
    """The pieces, those that no end pins down moved along the cable to where their course is known
    from."""
    if cable.closed or all(piece.pinned for piece in pieces):
        return list(pieces)
    steps, known = _steps(pieces), _known(cable, expected)
    slide = 0.0
    for _ in range(_ROUNDS):
        step = _slide(steps, slide, cable, known)
        slide += step
        if abs(step) < 0.05 * cable.width_px:
            break
    slide = float(
        np.clip(slide, -_MOST_SLIDE_WIDTHS * cable.width_px, _MOST_SLIDE_WIDTHS * cable.width_px)
    )
    return [
        piece if piece.pinned else piece._replace(position=piece.position + slide)
        for piece in pieces
    ]


def _steps(pieces: Sequence[Piece]) -> _Steps:
    parts = []
    for piece in pieces:
        steps, weight = piece.xy[1:] - piece.xy[:-1], trusted(piece)
        position = 0.5 * (piece.position[1:] + piece.position[:-1])
        direction, pinned = np.arctan2(steps[:, 1], steps[:, 0]), np.full(len(steps), piece.pinned)
        parts.append((position, direction, pinned, np.minimum(weight[1:], weight[:-1])))
    return _Steps(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _known(cable: TrackedCable, expected: FloatArray) -> FloatArray:
    """(NODES - 1, 3) between the nodes: the direction where the cable is expected, and of its
    course; what this one turns a px."""
    turns = np.empty(NODES - 1)
    turns[1:-1] = 0.5 * (cable.course[2:] - cable.course[:-2])
    turns[[0, -1]] = cable.course[1] - cable.course[0], cable.course[-1] - cable.course[-2]
    return np.column_stack(
        [course_of(expected), cable.course, turns * ((NODES - 1) / cable.length_px)]
    )


def _slide(steps: _Steps, slide: float, cable: TrackedCable, along: FloatArray) -> float:
    """Px by which the pieces that are not pinned are to be moved on from ``slide``, of what is
    known ``along`` the cable."""
    position = steps.position + slide * ~steps.pinned
    place = position * ((NODES - 1) / cable.length_px) - 0.5
    inside = (place > 0) & (place < NODES - 2)
    if np.count_nonzero(inside) < _LEAST_SAMPLES:
        return 0.0
    here, known, slope = between(along, place).T
    turns = steps.direction - here
    wanted = turns - 2 * np.pi * np.rint(turns / (2 * np.pi)) + here - known
    matrix = np.column_stack(
        [waves(np.clip(position / cable.length_px, 0.0, 1.0)), slope * ~steps.pinned]
    )
    off = _SLIDE_WIDTHS * cable.width_px + _OF_ADRIFT * cable.adrift_px
    precision = np.append(1 / _BENDS_RAD**2, 1 / off**2)
    pull = np.append(np.zeros(MODES), -slide * precision[-1])
    weighted = (matrix * (steps.weight * inside)[:, None]).T / (_NOISE_RAD**2 * _INDEPENDENT)
    return float(
        np.linalg.solve(weighted @ matrix + np.diag(precision), weighted @ wanted + pull)[-1]
    )


def laid_on(cable: TrackedCable, xy: FloatArray, seen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Nodes ``xy`` (NODES, 2) with tails by the course, where they are not ``seen``; and the course
    (NODES - 1,) learned anew from those that are. Unknown stretches of it are NaN before."""
    known = seen[1:] & seen[:-1]
    if known.sum() < _LEAST_SAMPLES:
        return xy, np.where(np.isnan(cable.course), course_of(xy), cable.course)
    now, course = course_of(xy), cable.course
    fitted = known & np.isfinite(course)
    bent = _bent(now - course, np.where(fitted, 1.0, _of_hidden(cable) * np.isfinite(course)))
    rest = now - course - bent
    change = np.where(known, _LEARNED * (bent + np.nan_to_num(rest)), _LEARNED * bent)
    course = np.where(np.isnan(course), now - bent, course + change)
    nodes, step = np.flatnonzero(known), cable.length_px / (NODES - 1)
    first, last = int(nodes[0]), int(nodes[-1])
    wanted = np.where(np.isnan(cable.course), now, cable.course + bent)
    angle = now + _PULL * np.angle(np.exp(1j * (wanted - now)))
    ways = step * np.column_stack([np.cos(angle), np.sin(angle)])
    xy = xy.copy()
    xy[last + 2 :] = xy[last + 1] + np.cumsum(ways[last + 1 :], axis=0)
    xy[:first] = xy[first] - np.cumsum(ways[:first][::-1], axis=0)[::-1]
    return xy, course


def _of_hidden(cable: TrackedCable) -> FloatArray:
    """(NODES - 1,) weight of the directions that places out of view are supposed to have: what went
    out of view a moment ago is still as it was."""
    spread = np.maximum(cable.spread[1:], cable.spread[:-1]) / cable.width_px
    return np.asarray(_OF_HIDDEN + (1 - _OF_HIDDEN) / (1.0 + (spread / _FORGOTTEN_WIDTHS) ** 4))


def _bent(change: FloatArray, weight: FloatArray) -> FloatArray:
    """(NODES - 1,) the smooth part of a change of direction whose places weigh (NODES - 1,)."""
    if np.count_nonzero(weight > 0.9) < _LEAST_SAMPLES:
        return np.zeros(NODES - 1)
    weighted = (_BASIS * weight[:, None]).T / (_NOISE_RAD**2 * _INDEPENDENT)
    system = weighted @ _BASIS + np.diag(1 / _BENDS_RAD**2)
    return np.asarray(_BASIS @ np.linalg.solve(system, weighted @ np.nan_to_num(change)))
