"""Samples to the levels by which a mask is read: gray of 8 or 16 bits, or color of 8."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workers.pictures.areas import Levels, ground_of
from workers.pictures.decoding import Samples, Values
from workers.pictures.photographs import eight_bits, white_of

_VOID = (224, 224, 192)
"""Color of index 255 in Pascal VOC: a rim of pixels that were left undecided."""


def levels_of(samples: Samples) -> tuple[Levels, int, list[str]]:
    """Gray of 8 or 16 bits or color of 8, the level that is white, and remarks."""
    values = samples.values
    alpha = samples.alpha
    if alpha is not None and (is_in_transparency(alpha, values) or _is_ground(alpha < 128)):
        return alpha, 255, ["has its mask in the transparency"]
    if samples.indices is not None:
        return _of_palette(samples.indices, values)
    if values.ndim == 3:
        return eight_bits(values)[0], 255, []
    if values.dtype == np.uint8:
        return values, 255, []
    white = white_of(values)
    if values.dtype == np.uint16:
        return (
            values,
            int(white) - 1,
            [] if white in (256, 65536) else [f"has values up to {values.max()}"],
        )
    if white <= 65536 and np.array_equal(values, np.rint(values)):
        return values.astype(np.uint16), max(int(white) - 1, 1), []
    scaled = np.rint(values.astype(np.float64) * (65535 / white)).clip(0, 65535).astype(np.uint16)
    return np.maximum(scaled, (values > 0).astype(np.uint16)), 65535, []


def is_in_transparency(alpha: NDArray[np.uint8], values: Values) -> bool:
    """Whether one color is all that can be seen, so that only the transparency has a shape."""
    return bool(np.ptp(values[alpha > 0].reshape(-1, *values.shape[2:]), axis=0).max() == 0)


def _is_ground(hidden: NDArray[np.bool_]) -> bool:
    """Whether the transparent pixels are most of the mask and of its border."""
    border = np.concatenate([hidden[0], hidden[-1], hidden[:, 0], hidden[:, -1]])
    return bool(hidden.mean() > 0.5 and border.mean() > 0.5)


def _of_palette(indices: NDArray[np.uint8], values: Values) -> tuple[Levels, int, list[str]]:
    """The colors, without the rim that Pascal VOC leaves undecided; the indices where the palette
    has one color."""
    if values.min() == values.max():
        return indices, 255, []
    void = indices == 255
    if values.ndim == 2 or not void.any() or tuple(values[void][0].tolist()) != _VOID or void.all():
        return values, 255, []
    ground = ground_of(np.where(void, 0, indices).astype(np.uint8)).level[0]
    known = values[indices == ground]
    return (
        np.where(void[:, :, None], known[0] if len(known) else 0, values),
        255,
        ["has index 255 as an undecided rim, which was left out"],
    )
