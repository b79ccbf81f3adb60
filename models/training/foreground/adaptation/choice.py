"""How much of what was learnt is kept, and whether the network is to be had at all.

Strategy: weights between the parent's and the adapted ones give networks between them: most of what
was learnt with little of what is forgotten. Of a few such mixtures the one is taken that is best on
the pictures kept aside less what it loses on renders. It is accepted only when it is no worse than
its parent on the former and hardly on the latter. What is better on one render does not make up for
what is worse on another: a course that also learns from renders gains on the hard ones while it
moves the edges of cables that the parent knew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array
from models.training.foreground.augmentation import UNKNOWN
from models.training.foreground.real_pictures import Photograph

SHARES = (1.0, 0.8, 0.65, 0.5, 0.35, 0.2)
MOST_FORGOTTEN = 1.0
"""Points of Dice on renders."""
_SMOOTH = 1e-3
"""Share of a picture's pixels that Dice adds to both sides: without a cable few false pixels cost
little."""

Probability = Callable[[ByteArray], Float32Array]
"""(H, W, 3) RGB to (H, W) probability of cable."""


@dataclass(frozen=True)
class Scores:
    """Dice in percent: of each picture ``aside``, and of each of the ``general`` renders."""

    aside: tuple[float, ...]
    general: tuple[float, ...]

    @property
    def mean(self) -> float:
        return float(np.mean(self.aside))

    @property
    def general_mean(self) -> float:
        return float(np.mean(self.general))

    def forgotten_by(self, other: Scores) -> float:
        """Points that another network loses on the renders on which it is worse, averaged over
        all."""
        return float(np.mean(np.maximum(np.subtract(self.general, other.general), 0.0)))


@dataclass(frozen=True)
class Exam:
    """What networks are measured on."""

    aside: Sequence[Photograph]
    general: Sequence[tuple[ByteArray, BoolArray]]
    threshold: float

    def scores(self, probability: Probability) -> Scores:
        aside = [
            dice(self.found(probability, p.rgb), p.labels == 255, p.labels != UNKNOWN)
            for p in self.aside
        ]
        general = [dice(self.found(probability, rgb), mask) for rgb, mask in self.general]
        return Scores(tuple(aside), tuple(general))

    def found(self, probability: Probability, rgb: ByteArray) -> BoolArray:
        return np.asarray(probability(rgb) >= self.threshold)


def dice(found: BoolArray, true: BoolArray, known: BoolArray | None = None) -> float:
    """In percent, over the pixels where one can tell."""
    if known is not None:
        found, true = found & known, true & known
    smooth = _SMOOTH * found.size
    both, total = np.count_nonzero(found & true), np.count_nonzero(found) + np.count_nonzero(true)
    return float(100 * (2 * both + smooth) / (total + smooth))


def best(before: Scores, mixtures: dict[float, Scores]) -> float:
    """The share of the learnt weights to keep, of those that are not refused if there are some; of
    equals the smallest."""
    allowed = [share for share, scores in mixtures.items() if refusal(before, scores) is None]

    def gain(share: float) -> float:
        scores = mixtures[share]
        return round(scores.mean - before.forgotten_by(scores), 2)

    return max(sorted(allowed or mixtures), key=gain)


def refusal(before: Scores, after: Scores) -> str | None:
    """Why the network must not be used; None if it may."""
    if after.mean < before.mean:
        return f"Dice on the pictures kept aside falls from {before.mean:.1f} to {after.mean:.1f}"
    lost = before.forgotten_by(after)
    if lost > MOST_FORGOTTEN:
        return f"it forgets: where Dice on the general set falls, it costs {lost:.1f}, more than {MOST_FORGOTTEN:g}"
    return None
