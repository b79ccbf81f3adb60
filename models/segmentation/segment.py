"""Picture to foreground probability with any network of the task ``foreground``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

_ABOVE_ZERO = 1e-6

Network = Callable[[NDArray[np.float32]], NDArray[np.float32]]


@dataclass(frozen=True)
class ForegroundInput:
    """How the network wants its picture: longest side in pixels, sides multiples of ``multiple``, values
    ``(x / 255 - mean) / std``; ``threshold`` is the one value that turns probability into a mask. A connected
    patch of that mask needs a mean probability of ``certainty`` and ``least_area`` pixels at the network's scale.
    """

    long_side: int
    multiple: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    threshold: float
    certainty: float
    least_area: float

    @classmethod
    def from_manifest(cls, preprocess: Mapping[str, Any]) -> ForegroundInput:
        values = dict(preprocess)
        values["mean"], values["std"] = tuple(values["mean"]), tuple(values["std"])
        return cls(**values)


def segment(image: NDArray[np.uint8], network: Network, settings: ForegroundInput) -> NDArray[np.float32]:
    """``image`` (H, W, 3) RGB to (H, W) probability of cable.

    The rule for every size: a picture longer than ``long_side`` is reduced to it (area average), a smaller
    one is left as it is; a strip keeps at least ``multiple`` pixels across, as long as that is no more than
    32 × ``long_side`` along. The sides are then filled up to a multiple by repeating the last row and column.
    The way back is the exact inverse: cut, then enlarge with pixel centers at ``(k + 0.5) s - 0.5``.
    """
    height, width = image.shape[:2]
    scale = _scale(height, width, settings)
    inner = max(round(width * scale), 1), max(round(height * scale), 1)
    small: NDArray[Any] = cv2.resize(image, inner, interpolation=cv2.INTER_AREA) if scale < 1 else image
    right, bottom = (-side % settings.multiple for side in inner)
    padded = cv2.copyMakeBorder(small, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
    mean, std = (np.array(v, np.float32) * 255.0 for v in (settings.mean, settings.std))
    planes = ((padded.astype(np.float32) - mean) / std).transpose(2, 0, 1)[None]
    logits = network(np.ascontiguousarray(planes))[0, 0, : inner[1], : inner[0]]
    probability = np.asarray(1.0 / (1.0 + np.exp(-logits)), np.float32)
    if scale == 1:
        return probability
    return np.asarray(cv2.resize(probability, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def foreground_mask(
    probability: NDArray[np.float32], settings: ForegroundInput, threshold: float | None = None
) -> NDArray[np.bool_]:
    """(H, W) bool. At the network's own threshold patches that are small or not certain are left out: a cable is
    certain along most of its length, a tool's edge is not. A ``threshold`` asked for is taken to the letter."""
    if threshold is not None:
        return np.asarray(probability >= max(threshold, _ABOVE_ZERO))
    mask = probability >= settings.threshold
    count, patches = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    sizes = np.bincount(patches.ravel(), minlength=count)
    sums = np.bincount(patches.ravel(), probability.ravel(), minlength=count)
    least = settings.least_area / _scale(mask.shape[0], mask.shape[1], settings) ** 2
    kept = (sums >= settings.certainty * sizes) & (sizes >= least)
    kept[0] = False
    return np.asarray(kept[patches])


def _scale(height: int, width: int, settings: ForegroundInput) -> float:
    fit = settings.long_side / max(height, width)
    return min(1.0, max(fit, min(settings.multiple / min(height, width), 32 * fit)))
