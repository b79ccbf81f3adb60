"""Whether what was sent as a picture is a mask: people open their harness masks as they open
photographs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workers.pictures.areas import ground_of, is_sharp
from workers.pictures.decoding import Samples
from workers.pictures.levels import is_in_transparency
from workers.pictures.photographs import eight_bits

_NEAR = 8
_APART = 64
_ON_TWO_VALUES = 0.95
"""Share of the pixels near one of two values; the others are smoothed outlines. No photograph has
so many."""
_EXACTLY = 0.9
_LEAST = 2e-4
_UNSEEN_RANGE = 32
"""Of 255: indices that are so close together would not be told apart in a photograph."""
_FEW = 256
_LOOKED_AT = 512
_DRAWN_ON = 0.8
"""Share of exact black that no photograph has."""


def why_a_mask(samples: Samples) -> str | None:
    """Words that continue "image"; None for a photograph or a drawing in colors."""
    if samples.alpha is not None and is_in_transparency(samples.alpha, samples.values):
        return "has its shape in the transparency"
    if samples.values.ndim == 3:
        return None if samples.lossy else _flat_colors(eight_bits(samples.values)[0])
    gray = eight_bits(samples.values)[0]
    if _has_two_values(gray, samples.lossy):
        return "has two values only"
    return None if samples.lossy else _few_indices(gray)


def _has_two_values(gray: NDArray[np.uint8], lossy: bool) -> bool:
    counts = np.bincount(gray.ravel(), minlength=256) / gray.size
    levels = np.arange(256)
    first = int(np.argmax(counts))
    second = int(np.argmax(np.where(np.abs(levels - first) >= _APART, counts, 0)))
    near = np.minimum(np.abs(levels - first), np.abs(levels - second)) <= _NEAR
    exact = counts[first] + counts[second]
    return bool(
        abs(first - second) >= _APART
        and counts[second] >= _LEAST
        and counts[near].sum() >= _ON_TWO_VALUES
        and (lossy or exact >= _EXACTLY)
    )


def _few_indices(gray: NDArray[np.uint8]) -> str | None:
    if np.ptp(gray) > _UNSEEN_RANGE or np.ptp(gray) == 0:
        return None
    ground = ground_of(gray)
    if ground.share < 0.5 or not is_sharp(ground.distance):
        return None
    return f"has {len(ground.distinct) + 1} values only, from {gray.min()} to {gray.max()}"


def _flat_colors(rgb: NDArray[np.uint8]) -> str | None:
    step = max(1, max(rgb.shape) // _LOOKED_AT)
    if np.mean(rgb[::step, ::step].any(axis=2)) > 0.5:
        return None
    ground = ground_of(rgb)
    if any(ground.level) or ground.share < 0.5:
        return None
    if len(ground.distinct) <= _FEW and is_sharp(ground.distance):
        return f"has {len(ground.distinct)} flat colors on black"
    return "is drawn on black" if ground.share >= _DRAWN_ON else None
