"""Where along its cable a run of an observation is.

Strategy: a run is a piece of the cable, so the arc length of its samples' places on the cable grows, or falls, as the
run's own: the median of their difference is where it starts. A free end near the free end that is known is the same
end, and pins the run down; one further away may be where something covers the cable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.tracking.ownership import Run
from models.tracking.state import Observation, TrackedCable

_SNAP_WIDTHS = 3.0
"""A free end so near to the known one is it."""
_AT_END = 0.01
_AS_LONG = 1.1
"""A strand between two free ends whose length differs by less than this factor is the whole cable."""


class Piece(NamedTuple):
    """Points ``xy`` (n, 2) of ``observed``, at ``position`` (n,) px along the cable, which grows; ``u0`` to ``u1`` of
    the observation's length are the first and the last of them; ``pinned`` by an end;
    ``trust`` (n,) as of the run."""

    observed: Observation
    xy: FloatArray
    position: FloatArray
    u0: float
    u1: float
    pinned: bool
    trust: FloatArray

    @property
    def length_px(self) -> float:
        return float(self.position[-1] - self.position[0])


def shows_all(piece: Piece, cable: TrackedCable) -> bool:
    """Whether it is a whole observation, from one free end to another, and pinned to both ends of the cable."""
    u0, u1 = sorted((piece.u0, piece.u1))
    off = abs(float(piece.position[0])) + abs(float(piece.position[-1]) - cable.length_px)
    return off < 1.0 and u0 < _AT_END and u1 > 1 - _AT_END and piece.observed.ends == ("free", "free")


def placed(run: Run, cable: TrackedCable) -> Piece:
    """The run at its place on ``cable``."""
    sign = _sign(run, cable)
    offset = run.place - sign * run.along
    start = _circular(offset, cable.length_px) if cable.closed else float(np.median(offset))
    return piece_at(run, cable, sign, start)


def piece_at(run: Run, cable: TrackedCable, sign: float, start: float) -> Piece:
    """The run with its observation's first point at ``start`` px of the cable, running with it (``sign`` 1) or against
    it (-1); free ends that meet those of the cable are moved onto them."""
    position, pinned = _pinned(start + sign * run.along, run, cable, sign)
    u0, u1 = run.along[[0, -1]] / max(run.observed.length_px, 1e-9)
    if sign < 0:
        return Piece(run.observed, run.xy[::-1], position[::-1], float(u1), float(u0), pinned, run.trust[::-1])
    return Piece(run.observed, run.xy, position, float(u0), float(u1), pinned, run.trust)


def _sign(run: Run, cable: TrackedCable) -> float:
    """Most steps decide: where the cable crosses itself a few places may be on its other strand."""
    steps = np.diff(run.place)
    usual = np.abs(steps) < 3 * np.diff(run.along).mean() if len(steps) else steps
    return 1.0 if np.sign(steps[usual]).sum() >= 0 else -1.0


def _circular(offset: FloatArray, length: float) -> float:
    turns = 2j * np.pi * offset / length
    return float(np.angle(np.exp(turns).mean()) * length / (2 * np.pi))


def _pinned(position: FloatArray, run: Run, cable: TrackedCable, sign: float) -> tuple[FloatArray, bool]:
    """``position`` moved, or stretched, so that free ends meet; and whether any did."""
    observed = run.observed
    known = ((0, 0.0), (1, cable.length_px)) if sign > 0 else ((1, cable.length_px), (0, 0.0))
    off: list[float | None] = [None, None]
    whole = (run.along[0] <= 1e-6, run.along[-1] >= observed.length_px - 1e-3 * observed.length_px)
    as_long = abs(np.log(run.length_px / cable.length_px)) < np.log(_AS_LONG) if run.length_px else False
    all_of_it = all(whole) and observed.ends == cable.ends == ("free", "free") and as_long
    for k, (end, at) in enumerate(known):
        slack = _SNAP_WIDTHS * cable.width_px + float(cable.spread[-end])
        free = whole[k] and observed.ends[k] == "free" and cable.ends[end] == "free" and not cable.closed
        if free and (all_of_it or abs(position[-k] - at) < slack):
            off[k] = at - float(position[-k])
    first, last = off
    if first is not None and last is not None:
        return position + np.linspace(first, last, len(position)), True
    shift = first if first is not None else last
    return (position, False) if shift is None else (position + shift, True)
