"""Whether something is over the cables: an arm, a hand, a tool.

Strategy: cables do not vanish where they lay a moment ago. When much of what was in view is gone at
once, and of some cable a part is still there, something covers the rest. Until about as much is in
view again, or no cable is in view in parts, what is seen is half a picture: strands end at the edge
of what covers them, and meet there with others. Then a track takes only what is certain, and learns
nothing new.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray
from models.tracking.ownership import Samples
from models.tracking.state import Cover, Observation, Track, TrackedCable

_GONE, _BACK = 0.15, 0.9
"""Share of the length in view that is missing when something covers the cables; share that is there
again after it."""
_OFF, _MOSTLY_OFF = 0.1, 0.9
"""Least share of the nodes in view so far that are without a strand: else cables merely left the
picture. Of one cable, between these shares of them: one that is gone altogether may have been taken
away."""
_OFF_WIDTHS, _MARGIN_WIDTHS = 1.5, 1.5
"""A strand so near is the cable's; a node so near to the picture's border may be outside."""
_KNOWN_AFTER = 4
"""In the first frames cables may be met too long."""
_FORGOTTEN = 0.998
"""Share of the length in view that is remembered from frame to frame: what stays covered is the
usual picture later."""


def cover_after(
    track: Track,
    observations: Sequence[Observation],
    samples: Samples | None,
    predicted: Sequence[FloatArray],
    size: tuple[int, int],
) -> Cover:
    """The cover in a picture of ``size`` (height, width) that shows ``observations`` where the
    cables of the track were ``predicted`` (NODES, 2)."""
    before, cables = track.cover, track.cables
    shown = sum(observed.length_px * _in_view(observed) for observed in observations)
    usual = max(_FORGOTTEN * before.shown_px, shown) if track.frame >= _KNOWN_AFTER else shown
    inside = [_inside(cable, xy, size) for cable, xy in zip(cables, predicted, strict=True)]
    if before.covered:
        parts = any(
            (mask & ~cable.seen).mean() >= _OFF for cable, mask in zip(cables, inside, strict=True)
        )
        return Cover(usual, parts and shown < _BACK * usual)
    gone = shown < (1 - _GONE) * usual
    return Cover(usual, gone and _partly_off(samples, cables, predicted, inside))


def _in_view(observed: Observation) -> float:
    """Share of an observation that is no bridged gap."""
    return 1.0 if observed.bridged is None else float((~observed.bridged).mean())


def _inside(cable: TrackedCable, xy: FloatArray, size: tuple[int, int]) -> BoolArray:
    """(NODES,) which nodes of a cable that was in view are in the picture."""
    margin = _MARGIN_WIDTHS * cable.width_px
    inside = ((xy > margin) & (xy < np.array(size[::-1]) - 1 - margin)).all(1)
    return np.asarray(inside & (cable.missed == 0))


def _partly_off(
    samples: Samples | None,
    cables: Sequence[TrackedCable],
    predicted: Sequence[FloatArray],
    inside: Sequence[BoolArray],
) -> bool:
    """Whether enough of the nodes whose place is known have no strand near them, and some of a
    cable that has one."""
    strands = np.zeros((0, 2)) if samples is None else samples.xy[samples.weight >= 1]
    if not len(strands):
        return False
    tree = cKDTree(strands)
    off, known = [], []
    for cable, xy, mask in zip(cables, predicted, inside, strict=True):
        near = _OFF_WIDTHS * cable.width_px
        distance, _ = tree.query(xy[mask & (cable.spread <= near)])
        off.append(int((distance > near).sum()))
        known.append(len(distance))
    parts = any(_OFF * n <= k <= _MOSTLY_OFF * n for k, n in zip(off, known, strict=True) if n)
    return parts and sum(off) >= _OFF * sum(known)
