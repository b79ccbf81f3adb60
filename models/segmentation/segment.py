"""Picture to foreground probability with any network of the task ``foreground``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array

_ABOVE_ZERO = 1e-6

Network = Callable[[Float32Array], Float32Array]


@dataclass(frozen=True)
class ForegroundInput:
    """How the network takes its picture: longest side in pixels, sides multiples of ``multiple``,
    values ``(x / 255 - mean) / std``; ``threshold`` is the one value that turns probability into a
    mask. A connected patch of that mask needs a mean probability of ``certainty`` and
    ``least_area`` pixels at the network's scale. A picture shorter than ``long_side`` is enlarged
    up to ``most_enlarged`` times.
    """

    long_side: int
    multiple: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    threshold: float
    certainty: float
    least_area: float
    most_enlarged: float = 1.0

    @classmethod
    def from_manifest(cls, preprocess: Mapping[str, Any]) -> ForegroundInput:
        values = dict(preprocess)
        values["mean"], values["std"] = tuple(values["mean"]), tuple(values["std"])
        return cls(**values)


def segment(image: ByteArray, network: Network, settings: ForegroundInput) -> Float32Array:
    """``image`` (H, W, 3) RGB to (H, W) probability of cable, in one pass at
    :func:`network_scale`."""
    scale = network_scale(image.shape[:2], settings)
    return enlarged(probability_at(image, network, settings, scale), image.shape[:2])


def network_scale(size: tuple[int, ...], settings: ForegroundInput) -> float:
    """The rule for every ``size`` (H, W): a picture longer than ``long_side`` is reduced to it, a
    smaller one is enlarged to it, at most ``most_enlarged`` times; a strip keeps at least
    ``multiple`` pixels across, as long as that is no more than 32 × ``long_side`` along."""
    fit = settings.long_side / max(size)
    if fit >= 1.0:
        return min(settings.most_enlarged, fit)
    return min(1.0, max(fit, min(settings.multiple / min(size), 32 * fit)))


def probability_at(
    image: ByteArray, network: Network, settings: ForegroundInput, scale: float
) -> Float32Array:
    """What the network sees in ``image`` (H, W, 3) resized by ``scale``: probability (round(scale
    H), round(scale W)).

    Reduced by the average over areas, enlarged linearly; then filled up to the multiple by
    repeating the last row and column, which are cut off again.
    """
    height, width = image.shape[:2]
    inner = max(round(width * scale), 1), max(round(height * scale), 1)
    if inner != (width, height):
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        image = np.asarray(cv2.resize(image, inner, interpolation=way), np.uint8)
    right, bottom = (-side % settings.multiple for side in inner)
    padded = np.asarray(
        cv2.copyMakeBorder(image, 0, bottom, 0, right, cv2.BORDER_REPLICATE), np.uint8
    )
    logits = network(normalized(padded, settings))[0, 0, : inner[1], : inner[0]]
    odds_against = np.exp(-logits)
    odds_against += 1.0
    return np.reciprocal(odds_against, out=odds_against)


def normalized(image: ByteArray, settings: ForegroundInput) -> Float32Array:
    """(H, W, 3) to the network's (1, 3, H, W). A table of the 256 values of each channel: a quarter
    of the time."""
    planes = np.empty((1, 3, *image.shape[:2]), np.float32)
    values = np.arange(256, dtype=np.float32)
    for k, plane in enumerate(cv2.split(image)):
        mean, std = (np.float32(v[k]) * np.float32(255.0) for v in (settings.mean, settings.std))
        cv2.LUT(plane, (values - mean) / std, dst=planes[0, k])
    return planes


def enlarged(probability: Float32Array, size: tuple[int, int]) -> Float32Array:
    """(h, w) to ``size`` (H, W), linearly, pixel centers at ``(k + 0.5) s - 0.5``."""
    if probability.shape == size:
        return probability
    return np.asarray(
        cv2.resize(probability, size[::-1], interpolation=cv2.INTER_LINEAR), np.float32
    )


def foreground_mask(
    probability: Float32Array, settings: ForegroundInput, threshold: float | None = None
) -> BoolArray:
    """(H, W) bool. At the network's own threshold patches that are small or not certain are left
    out: a cable is certain along most of its length, a tool's edge is not. A ``threshold`` asked
    for is applied as it is."""
    if threshold is not None:
        return np.asarray(probability >= max(threshold, _ABOVE_ZERO))
    mask = probability >= settings.threshold
    count, patches = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    patch = patches[mask]
    sizes = np.bincount(patch, minlength=count)
    sums = np.bincount(patch, probability[mask], minlength=count)
    least = settings.least_area / network_scale(mask.shape, settings) ** 2
    kept = (sums >= settings.certainty * sizes) & (sizes >= least)
    mask[mask] = kept[patch]
    return mask
