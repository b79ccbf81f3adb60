"""The instance methods with their networks, and worn masks, for the benchmarks."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from models.instances.methods import method as table_method
from models.instances.scene import Scene
from models.weights.inference import Runtime, default_name, load

Extract = Callable[[np.ndarray, np.ndarray | None], Scene]
METHODS = ("section_matching", "rt_dlo", "fastdlo", "ariadne_plus")


def method(name: str, **values: float) -> Extract:
    """One method on one thread; ``values`` are its parameters where they are not the defaults."""
    return table_method(name, lambda task: load(default_name(task), Runtime(threads=1)), **values)[
        0
    ]


def eroded(mask: np.ndarray, times: int) -> np.ndarray:
    """Thinned by a pixel all around, so many times (3 x 3 kernel, thesis 3.6.3)."""
    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=times) > 0


def with_holes(mask: np.ndarray, seed: int, count: int = 8, side: int = 5) -> np.ndarray:
    """Squares cleared around foreground pixels drawn at random; the same seed gives the same
    holes."""
    out = mask.copy()
    rows, columns = np.nonzero(mask)
    for k in np.random.default_rng([5, seed]).integers(
        0, max(len(rows), 1), count if len(rows) else 0
    ):
        half = side // 2
        out[
            max(rows[k] - half, 0) : rows[k] + half + 1,
            max(columns[k] - half, 0) : columns[k] + half + 1,
        ] = False
    return out


def closed(mask: np.ndarray, side: int = 7) -> np.ndarray:
    """Gaps narrower than the kernel filled."""
    return (
        cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
        > 0
    )


def gray(image: np.ndarray) -> np.ndarray:
    """The picture without its color, still of three channels."""
    return np.repeat(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)[:, :, None], 3, axis=2)
