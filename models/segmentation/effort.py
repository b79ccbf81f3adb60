"""How hard to look for the foreground: fast, normal or thorough.

Fast and normal take a network's 8-bit form where there is one, fast at two thirds of the network's
scale; thorough takes the network itself, at three scales and mirrored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from models.geometry.arrays import ByteArray, Float32Array
from models.segmentation.segment import (
    ForegroundInput,
    Network,
    enlarged,
    network_scale,
    probability_at,
)
from models.segmentation.thick_strands import look_from_afar
from models.segmentation.thin_strands import look_closer

Effort = Literal["fast", "normal", "thorough"]


@dataclass(frozen=True)
class Passes:
    """``longest`` side of the picture that is seen, over that of the network; ``scales`` of this at
    which the whole picture is seen, ``mirrored`` too; ``closer`` bounds the second look at thin
    strands, in pixels over those of one pass, thick ones are looked at from afar, too, where it is
    not 0; ``eight_bit``: with the network's 8-bit form."""

    longest: float
    scales: tuple[float, ...]
    mirrored: bool
    closer: float
    eight_bit: bool


PASSES: Mapping[Effort, Passes] = {
    "fast": Passes(2 / 3, (1.0,), mirrored=False, closer=0.0, eight_bit=True),
    "normal": Passes(1.0, (1.0,), mirrored=False, closer=4.5, eight_bit=True),
    "thorough": Passes(1.0, (2 / 3, 1.0, 4 / 3), mirrored=True, closer=12.0, eight_bit=False),
}


def look(
    image: ByteArray, network: Network, settings: ForegroundInput, effort: Effort = "normal"
) -> Float32Array:
    """``image`` (H, W, 3) RGB to (H, W) probability of cable."""
    passes = PASSES[effort]
    scale = network_scale(
        image.shape[:2], replace(settings, long_side=round(passes.longest * settings.long_side))
    )
    scales = [scale * factor for factor in sorted(passes.scales, reverse=True)]
    seen = [_at(image, network, settings, s, passes.mirrored) for s in scales]
    whole = seen[0] if len(seen) == 1 else _agreed([enlarged(p, seen[0].shape) for p in seen])
    if passes.closer == 0.0:
        return enlarged(whole, image.shape[:2])
    whole = look_from_afar(image, whole, network, settings)
    return look_closer(image, whole, network, settings, passes.closer)


def _at(
    image: ByteArray, network: Network, settings: ForegroundInput, scale: float, mirrored: bool
) -> Float32Array:
    seen = probability_at(image, network, settings, scale)
    if not mirrored:
        return seen
    other = probability_at(np.ascontiguousarray(image[:, ::-1]), network, settings, scale)
    return np.asarray((seen + other[:, ::-1]) / 2, np.float32)


def _agreed(seen: list[Float32Array]) -> Float32Array:
    """The mean of passes is right more often than each of them but less certain: its odds are
    squared, which leaves one half where it is."""
    mean = np.mean(seen, axis=0)
    return np.asarray(mean**2 / (mean**2 + (1 - mean) ** 2), np.float32)
