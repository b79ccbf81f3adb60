"""How hard to look for the foreground: fast, normal or thorough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from models.geometry.arrays import ByteArray, Float32Array
from models.segmentation.segment import ForegroundInput, Network, enlarged, network_scale, probability_at
from models.segmentation.thin_strands import look_closer

Effort = Literal["fast", "normal", "thorough"]


@dataclass(frozen=True)
class Passes:
    """``scales`` of the network's own at which the whole picture is seen, ``mirrored`` too; ``closer`` bounds the
    second look at thin strands, in pixels over those of one pass."""

    scales: tuple[float, ...]
    mirrored: bool
    closer: float


PASSES: Mapping[Effort, Passes] = {
    "fast": Passes((1.0,), mirrored=False, closer=0.0),
    "normal": Passes((1.0,), mirrored=False, closer=4.5),
    "thorough": Passes((0.7, 1.0, 1.5), mirrored=True, closer=12.0),
}


def look(image: ByteArray, network: Network, settings: ForegroundInput, effort: Effort = "normal") -> Float32Array:
    """``image`` (H, W, 3) RGB to (H, W) probability of cable."""
    passes = PASSES[effort]
    scale = network_scale(image.shape[:2], settings)
    seen = _mean(image, network, settings, [scale * factor for factor in passes.scales], passes.mirrored)
    if passes.closer == 0.0:
        return enlarged(seen, image.shape[:2])
    return look_closer(image, seen, network, settings, passes.closer)


def _mean(
    image: ByteArray, network: Network, settings: ForegroundInput, scales: list[float], mirrored: bool
) -> Float32Array:
    """Mean of the passes, at the size of the largest of them."""
    views = [image, np.ascontiguousarray(image[:, ::-1])] if mirrored else [image]
    seen: list[Float32Array] = []
    for scale in sorted(scales, reverse=True):
        for k, view in enumerate(views):
            probability = probability_at(view, network, settings, scale)
            seen.append(np.ascontiguousarray(probability[:, ::-1]) if k else probability)
    return np.asarray(np.mean([enlarged(p, seen[0].shape) for p in seen], axis=0), np.float32) if seen[1:] else seen[0]
