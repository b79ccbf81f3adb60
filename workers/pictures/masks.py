"""Samples to foreground: whatever is not background is cable.

Strategy: the background is the value (gray level, color, index) that holds most of the picture and
of its border. Where outlines are sharp, every other value is cable, be it 1, 2 or red. Otherwise a
gray mask is read as probability, unless whole areas have a level below the half; these, and colors,
count by the area that is nearest in color. What is neither is refused, with words that state what
was found.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workers.pictures.areas import (
    Ground,
    Levels,
    area_colors,
    ground_of,
    is_sharp,
    is_steep,
    nearer_than_ground,
)
from workers.pictures.decoding import Samples
from workers.pictures.headers import PictureError
from workers.pictures.levels import levels_of

Float = NDArray[np.float32]

_LISTED = 6
_PHOTOGRAPH = "looks like a photograph, not like a mask: send it as `image`"
_BETWEEN = 0.1
"""A gray level farther than this from black and from white is neither."""
_LEAST_GROUND = 0.4
"""A mask has exactly one color on this share of it at least, also after JPEG; a photograph has
not."""
_FEW_COLORS = 256
_DIMMEST = 8
_LIGHT = 0.55
"""Mean of the mask and of its border above which the ground is white."""
_LOSSY_TOLERANCE = 16
_ROUNDED = 2
_CONVENTIONAL = ([(1,)], [(255,)], [(65535,)], [(255, 255, 255)])
"""What stands out of a black ground in masks that need no remark."""


def foreground_of(samples: Samples) -> tuple[Float, list[str]]:
    """Probability (H, W) of cable, and remarks. Raises PictureError."""
    levels, white, remarks = levels_of(samples)
    remarks = [*samples.remarks, *remarks]
    ground = ground_of(levels)
    if not ground.distance.any():
        return _of_one_value(ground, levels.shape[:2], remarks)
    if not samples.lossy and is_sharp(ground.distance):
        return (ground.distance > 0).astype(np.float32), [*remarks, *_described(ground)]
    tolerance = _LOSSY_TOLERANCE if samples.lossy else _ROUNDED
    if levels.ndim == 3:
        return _of_colors(levels.astype(np.uint8), ground, tolerance, remarks)
    if ground.share >= _LEAST_GROUND and _BETWEEN < ground.level[0] / white < 1 - _BETWEEN:
        gray = np.rint(levels * (255 / white)).clip(0, 255).astype(np.uint8)
        return _of_colors(gray, ground_of(gray), tolerance, remarks)
    return _of_gray(levels, white, tolerance, remarks)


def _of_one_value(
    ground: Ground, size: tuple[int, ...], remarks: list[str]
) -> tuple[Float, list[str]]:
    if any(ground.level):
        raise PictureError(f"is {_name(ground.level)} everywhere: no cable is outlined in it")
    return np.zeros(size, np.float32), [*remarks, "is 0 everywhere: it holds no cable"]


def _described(ground: Ground) -> list[str]:
    """What was taken as cable, unless it is white or 1 on black."""
    if not any(ground.level) and ground.distinct in _CONVENTIONAL:
        return []
    names = [_name(level) for level in ground.distinct[:_LISTED]]
    if len(ground.distinct) > _LISTED:
        names.append(f"{len(ground.distinct) - _LISTED} more")
    return [
        f"has {_name(ground.level)} as background ({ground.share:.0%} of it); every other value ({', '.join(names)}) "
        "was taken as cable"
    ]


def _name(level: tuple[int, ...]) -> str:
    return str(level[0]) if len(level) == 1 else f"RGB {level}"


def _of_gray(
    levels: Levels, white: int, tolerance: int, remarks: list[str]
) -> tuple[Float, list[str]]:
    """A probability, turned round where most of the mask and of its border is light."""
    probability = np.minimum(levels.astype(np.float32) / np.float32(white), 1)
    between = np.mean((probability > _BETWEEN) & (probability < 1 - _BETWEEN))
    if between > 0.5:
        raise PictureError(f"{_PHOTOGRAPH}; {between:.0%} of it is neither black nor white")
    border = np.concatenate(
        [probability[0], probability[-1], probability[:, 0], probability[:, -1]]
    )
    if min(probability.mean(), border.mean()) > _LIGHT:
        light = float(np.mean(probability >= 0.5))
        probability = 1 - probability
        remarks = [
            *remarks,
            f"is light for the most part ({light:.0%}): the dark was taken as cable",
        ]
    gray = np.rint(probability * 255).astype(np.uint8)
    dim = [int(level) for level in area_colors(gray, gray, tolerance)[:, 0]]
    dim = [
        level for level in dim if _DIMMEST <= level < 128 and is_steep(gray, level, gray, tolerance)
    ]
    if dim:
        colors = np.array([*dim, 255], np.uint8)[:, None]
        dimmed = nearer_than_ground(gray, (0,), colors) & (gray >= min(dim) // 2)
        found = ", ".join(map(str, dim))
        remarks = [
            *remarks,
            f"has areas of level {found} (white is 255), which were taken as cable",
        ]
        return dimmed.astype(np.float32), remarks
    highest = float(probability.max())
    if highest < 0.5:
        remarks = [
            *remarks,
            f"is a probability of {highest:.2f} at most: where it is below the threshold is no cable",
        ]
    return probability, remarks


def _of_colors(
    levels: NDArray[np.uint8], ground: Ground, tolerance: int, remarks: list[str]
) -> tuple[Float, list[str]]:
    """Cable is what is nearer to the color, or the gray, of another area than to the ground."""
    distance = ground.distance.astype(np.uint8)
    if ground.share < _LEAST_GROUND and len(ground.distinct) > _FEW_COLORS:
        found = (
            f"more than {_FEW_COLORS} colors, the most frequent of them on {ground.share:.0%} of it"
        )
        raise PictureError(f"{_PHOTOGRAPH}; it has {found}")
    colors = area_colors(levels, distance, tolerance)
    if len(colors):
        cable = nearer_than_ground(levels, ground.level, colors) & (distance > tolerance)
        names = ", ".join(_name(tuple(color)) for color in colors[:_LISTED].tolist())
    else:  # lines so thin that no pixel has its own color all around it
        strongest = (
            float(np.percentile(distance[distance > tolerance], 95))
            if (distance > tolerance).any()
            else 255.0
        )
        cable, names = distance >= max(strongest / 2, tolerance), "thin lines"
    remark = f"has {_name(ground.level)} as background; the rest ({names}) was taken as cable"
    return cable.astype(np.float32), [*remarks, remark]
