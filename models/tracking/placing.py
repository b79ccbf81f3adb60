"""Where along its cable a run of an observation is.

Strategy: a run is a piece of the cable, so the arc length of its samples' places on the cable
grows, or falls, as the run's own: the median of their difference is where it starts. A free end
near the free end that is known is the same end, and pins the run down; one further away may be
where something covers the cable. How near it has to be depends on how far the cable may have slid
along itself since an end of it was seen; nor does a cable reach beyond an end of it that is known,
as far as it may have slid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.geometry.arrays import FloatArray
from models.instances.scene import EndpointKind
from models.tracking.nodes import middle
from models.tracking.ownership import Run
from models.tracking.state import NODES, Observation, TrackedCable

_SNAP_WIDTHS = 3.0
"""A free end so near to the known one, and as far as the cable may have slid, is it."""
_AT_END = 0.01
_AS_LONG = 1.04
"""A strand between two free ends whose length differs by less than this factor is the whole
cable."""


class Piece(NamedTuple):
    """Points ``xy`` (n, 2) of ``observed``, at ``position`` (n,) px along the cable, which grows;
    ``u0`` to ``u1`` of the observation's length are the first and the last of them; ``pinned`` by
    an end; ``trust`` (n,) as of the run."""

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
    """Whether it is a whole observation, from one free end to another, and pinned to both ends of
    the cable."""
    u0, u1 = sorted((piece.u0, piece.u1))
    off = abs(float(piece.position[0])) + abs(float(piece.position[-1]) - cable.length_px)
    return (
        off < 1.0 and u0 < _AT_END and u1 > 1 - _AT_END and piece.observed.ends == ("free", "free")
    )


def placed(run: Run, cable: TrackedCable) -> Piece:
    """The run at its place on ``cable``."""
    sign = _sign(run)
    offset = run.place - sign * run.along
    start = _circular(offset, cable.length_px) if cable.closed else middle(offset)
    return piece_at(run, cable, sign, start)


def piece_at(run: Run, cable: TrackedCable, sign: float, start: float) -> Piece:
    """The run with its observation's first point at ``start`` px of the cable, running with it
    (``sign`` 1) or against it (-1); free ends that meet those of the cable are moved onto them."""
    position, way = start + sign * run.along, slice(None, None, int(sign))
    u0, u1 = (run.along[way] / max(run.observed.length_px, 1e-9))[[0, -1]].tolist()
    return pinned_down(
        Piece(run.observed, run.xy[way], position[way], u0, u1, False, run.trust[way]), cable
    )


def _sign(run: Run) -> float:
    """Most steps decide: where the cable crosses itself a few places may be on its other strand."""
    steps = np.diff(run.place)
    usual = np.abs(steps) < 3 * np.diff(run.along).mean() if len(steps) else steps
    return 1.0 if np.sign(steps[usual]).sum() >= 0 else -1.0


def _circular(offset: FloatArray, length: float) -> float:
    turns = 2j * np.pi * offset / length
    return float(np.angle(np.exp(turns).mean()) * length / (2 * np.pi))


def pinned_down(piece: Piece, cable: TrackedCable) -> Piece:
    """The piece moved, or stretched, so that its free ends meet those of the cable; else so that it
    does not reach beyond them."""
    position = piece.position
    free = [end_kind(piece, u) == "free" and not cable.closed for u in (piece.u0, piece.u1)]
    known = [kind == "free" for kind in cable.ends]
    as_long = piece.length_px > 0 and abs(np.log(piece.length_px / cable.length_px)) < np.log(
        _AS_LONG
    )
    all_of_it = as_long and all(free) and all(known)
    node = np.clip(np.rint(position * ((NODES - 1) / cable.length_px)), 0, NODES - 1).astype(int)
    slack = _SNAP_WIDTHS * cable.width_px + cable.adrift_px + float(cable.spread[node].min())
    off = -float(position[0]), cable.length_px - float(position[-1])
    meets = [free[k] and known[k] and (all_of_it or abs(off[k]) < slack) for k in (0, 1)]
    if all(meets):
        return piece._replace(position=position + np.linspace(*off, len(position)), pinned=True)
    if any(meets):
        return piece._replace(position=position + off[meets.index(True)], pinned=True)
    return piece._replace(position=position + _back(position, cable))


def end_kind(piece: Piece, u: float) -> EndpointKind:
    """What is at the place ``u`` of the piece's observation."""
    if u < _AT_END:
        return piece.observed.ends[0]
    return piece.observed.ends[1] if u > 1 - _AT_END else "hidden"


def _back(position: FloatArray, cable: TrackedCable) -> float:
    """Px by which a piece at ``position`` (n,) is moved, so that it does not reach beyond a known
    end of its cable; 0 where it reaches further than the cable may have slid: then the end is
    elsewhere."""
    if cable.closed:
        return 0.0
    below = max(-float(position.min()), 0.0) if cable.ends[0] == "free" else 0.0
    above = max(float(position.max()) - cable.length_px, 0.0) if cable.ends[1] == "free" else 0.0
    return below - above if max(below, above) <= cable.adrift_px else 0.0
