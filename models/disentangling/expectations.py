"""Stated probabilities after actions that were carried out: what worked less often than it should
is expected less."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.arrays import FloatArray

_SPREAD, _SPREAD_ALIKE = 1.0, 2.0
"""Of the log odds, how far off they may be for a harness as a whole, and for one turn about one
place."""
_NEAR = 1.5
"""Hands between the places held of two turns that are alike …"""
_ALIKE_RAD = float(np.deg2rad(30))
"""… and between their angles."""
_LEAST = 1e-3
"""Probabilities are kept so far from 0 and 1, where their odds are infinite."""


@dataclass(frozen=True)
class Attempt:
    """A turn that was carried out: ``hold`` where, ``turn`` radians, the ``score`` that it had, and
    whether no more crossings were left than expected."""

    hold: tuple[float, float]
    turn: float
    score: float
    worked: bool

    def scaled(self, factor: float) -> Attempt:
        return replace(self, hold=(factor * self.hold[0], factor * self.hold[1]))


def updated(
    scores: FloatArray, holds: FloatArray, turns: FloatArray, attempts: Sequence[Attempt]
) -> FloatArray:
    """``scores`` (T,) of turns by ``turns`` (T,) about ``holds`` (T, 2) in hands, in the light of
    the attempts.

    Strategy: two offsets of the log odds, one for all turns and one for those that are alike, each
    with a normal prior; the posterior's mode after one Newton step.
    """
    if not attempts or not len(scores):
        return scores
    stated = np.clip([a.score for a in attempts], _LEAST, 1 - _LEAST)
    surprise = np.array([a.worked for a in attempts]) - stated
    information = stated * (1 - stated)
    everywhere = surprise.sum() / (1 / _SPREAD**2 + information.sum())
    where, angle = np.array([a.hold for a in attempts]), np.array([a.turn for a in attempts])
    near = np.hypot(*np.moveaxis(holds[:, None] - where, -1, 0)) <= _NEAR
    alike = near & (np.abs(turns[:, None] - angle) <= _ALIKE_RAD)
    there = (alike @ surprise) / (1 / _SPREAD_ALIKE**2 + alike @ information)
    clipped = np.clip(scores, _LEAST, 1 - _LEAST)
    return np.asarray(1 / (1 + (1 / clipped - 1) * np.exp(-everywhere - there)))
