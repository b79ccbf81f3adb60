"""The course of a cable, its direction along it: what a place is recognised by, and how a tail out of view goes on.

Strategy: a cable that is moved turns and bends smoothly: what is added to its direction is a sum of a few cosines along
it, the smaller the shorter their waves. The rest of its course stays. So the course seen over many frames tells how far
a piece that shows no end has slid along the cable, without a sum of errors from frame to frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.tracking.placing import Piece
from models.tracking.sliding import MODES, waves
from models.tracking.state import NODES, TrackedCable

_BENDS_RAD = 1.2 / np.maximum(np.arange(MODES), 0.1) ** 2
"""Standard deviation of what each cosine adds to the direction; a turn of the whole is free."""
_MIDDLES_U = (np.arange(NODES - 1) + 0.5) / (NODES - 1)
_NOISE_RAD, _INDEPENDENT = 0.06, 3.0
"""Of a direction between two samples; so many neighboring ones err alike."""
_SLIDE_WIDTHS = 0.5
"""By which the place that the motion tells is off, usually."""
_MOST_SLIDE_WIDTHS, _ROUNDS = 3.0, 3
_LEARNED = 0.03
"""Share of a new course that replaces the one remembered, in a frame."""
_LEAST_SAMPLES = 6
_OF_HIDDEN = 0.03
"""Weight of the direction that a place out of view is supposed to have, against one in view."""
_PULL = 0.15
"""Share of the way from where its velocity brings a tail out of view to where its course has it, in a frame."""


def course_of(xy: FloatArray) -> FloatArray:
    """(n - 1,) directions between points (n, 2), rad, without jumps."""
    steps = np.diff(xy, axis=0)
    return np.asarray(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))


def recognised(pieces: Sequence[Piece], cable: TrackedCable, expected: FloatArray) -> list[Piece]:
    """The pieces, those that no end pins down moved along the cable to where their course is known from."""
    if cable.closed or all(piece.pinned for piece in pieces):
        return list(pieces)
    usual, before = course_of(expected), cable.course
    slide = 0.0
    for _ in range(_ROUNDS):
        step = _slide(pieces, slide, cable, usual, before)
        slide += step
        if abs(step) < 0.05 * cable.width_px:
            break
    slide = float(np.clip(slide, -_MOST_SLIDE_WIDTHS * cable.width_px, _MOST_SLIDE_WIDTHS * cable.width_px))
    return [piece if piece.pinned else piece._replace(position=piece.position + slide) for piece in pieces]


def _slide(pieces: Sequence[Piece], slide: float, cable: TrackedCable, usual: FloatArray, before: FloatArray) -> float:
    """Px by which the pieces that are not pinned are to be moved on from ``slide``."""
    at = _MIDDLES_U * cable.length_px
    rising = np.gradient(before, cable.length_px / (NODES - 1))
    rows, values = [], []
    for piece in pieces:
        position = piece.position if piece.pinned else piece.position + slide
        steps = np.diff(piece.xy, axis=0)
        direction = np.arctan2(steps[:, 1], steps[:, 0])
        middle = 0.5 * (position[1:] + position[:-1])
        inside = (middle > at[0]) & (middle < at[-1])
        middle, direction = middle[inside], direction[inside]
        here, known = np.interp(middle, at, usual), np.interp(middle, at, before)
        turned = np.angle(np.exp(1j * (direction - here))) + here - known
        slope = np.zeros(len(middle)) if piece.pinned else np.interp(middle, at, rising)
        rows.append(np.column_stack([waves(middle / cable.length_px), slope]))
        values.append(turned)
    matrix, wanted = np.concatenate(rows), np.concatenate(values)
    if len(wanted) < _LEAST_SAMPLES:
        return 0.0
    precision = np.append(1 / _BENDS_RAD**2, 1 / (_SLIDE_WIDTHS * cable.width_px) ** 2)
    weight = 1 / (_NOISE_RAD**2 * _INDEPENDENT)
    pull = np.append(np.zeros(MODES), -slide * precision[-1])
    system = weight * (matrix.T @ matrix) + np.diag(precision)
    return float(np.linalg.solve(system, weight * (matrix.T @ wanted) + pull)[-1])


def laid_on(cable: TrackedCable, xy: FloatArray, seen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Nodes ``xy`` (NODES, 2) with tails by the course, where they are not ``seen``; and the course (NODES - 1,)
    learned anew from those that are. Unknown stretches of it are NaN before."""
    known = seen[1:] & seen[:-1]
    if known.sum() < _LEAST_SAMPLES:
        return xy, np.where(np.isnan(cable.course), course_of(xy), cable.course)
    now, course = course_of(xy), cable.course
    fitted = known & np.isfinite(course)
    bent = _bent(now - course, np.where(fitted, 1.0, _OF_HIDDEN * np.isfinite(course)))
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


def _bent(change: FloatArray, weight: FloatArray) -> FloatArray:
    """(NODES - 1,) the smooth part of a change of direction whose places weigh (NODES - 1,)."""
    if np.count_nonzero(weight >= 1) < _LEAST_SAMPLES:
        return np.zeros(NODES - 1)
    basis = waves(_MIDDLES_U)
    weighted = (basis * weight[:, None]).T / (_NOISE_RAD**2 * _INDEPENDENT)
    system = weighted @ basis + np.diag(1 / _BENDS_RAD**2)
    return np.asarray(basis @ np.linalg.solve(system, weighted @ np.nan_to_num(change)))
