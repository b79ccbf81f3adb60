"""Foreground up to the picture's edge and over it, and the distances in it.

What is outside a picture is not seen. A strand that leaves the picture goes on there; a strand that
runs along its edge has its side there. Both must hold at once: without the first a strand would end
in a fork at the border and be thin there, without the second it would seem twice as wide as it is
and its middle would be on the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array
from models.geometry.components import runs

ALONG = 4.5
"""Foreground at the edge runs along it where its length is more than this times its typical depth.
Lengths count less the more uneven the depth is: where a strand leaves at a low angle it goes from
nothing to the full width. On rendered scenes 2 to 6 depths are equally good
(``tests.benchmarks.bench_border``)."""
_MARGIN_PX, _MOST_MARGIN_PX = 12, 60
"""Half the margin of a narrow and of a very wide strand."""


@dataclass(frozen=True, eq=False)
class Foreground:
    """``mask``: ``(H, W)``; ``width_px``: the typical width of what is in it, 0 without any;
    ``beyond``: ``(H + 2 m, W + 2 m)`` the mask as it probably goes on over the picture's edge, by
    ``margin`` m pixels, an even number."""

    mask: BoolArray
    width_px: float
    beyond: BoolArray
    margin: int

    @classmethod
    def of(cls, mask: BoolArray, width_px: float = 0.0) -> Foreground:
        """The margin is two widths: a strand forks where it is cut off square, half a width before
        its end or more where it left the picture at a low angle."""
        margin = 2 * int(np.clip(width_px, _MARGIN_PX, _MOST_MARGIN_PX))
        return cls(mask, width_px, framed(mask, margin).view(bool), margin)

    @cached_property
    def distances(self) -> Float32Array:
        """``(H, W)`` distance of every foreground pixel to the nearest background pixel's center, 0
        on background.

        A mask without background, also none at its edge, has no distances and gives zeros.
        """
        if not self.mask.size or self.beyond.all():
            return np.zeros(self.mask.shape, dtype=np.float32)
        cut = self.margin - 1
        around = self.beyond[cut:-cut, cut:-cut].view(np.uint8)
        found = cv2.distanceTransform(around, cv2.DIST_L2, cv2.DIST_MASK_5)
        return np.ascontiguousarray(found[1:-1, 1:-1], dtype=np.float32)


def distance_map(mask: BoolArray) -> Float32Array:
    """:attr:`Foreground.distances` of a mask."""
    return Foreground.of(np.ascontiguousarray(mask, dtype=bool)).distances


def framed(mask: BoolArray | ByteArray, margin: int) -> ByteArray:
    """``(H + 2 m, W + 2 m)`` of 0 and 1: the mask carried on over the picture's edge by ``margin``
    pixels.

    Strategy: every pixel of the edge is repeated outwards, but for foreground that runs along the
    edge: outside of it is background.
    """
    if not mask.size:
        return np.zeros([size + 2 * margin for size in mask.shape], dtype=np.uint8)
    binary = np.ascontiguousarray(mask).view(np.uint8)
    out = np.asarray(
        cv2.copyMakeBorder(binary, margin, margin, margin, margin, cv2.BORDER_REPLICATE), np.uint8
    )
    for turned in (out, out[::-1], out.T, out.T[::-1]):
        _wall(turned, margin)
    return out


def _wall(framed_mask: ByteArray, size: int) -> None:
    """Clear, in place, what the upper margin holds above foreground that runs along the edge."""
    inner = framed_mask[size : framed_mask.shape[0] - size, size : framed_mask.shape[1] - size]
    if not inner[0].any():
        return
    for start, stop in runs(inner[0] > 0):
        # Deeper than its length divided by ALONG, it cannot be foreground along the edge.
        reach = int((stop - start) / ALONG) + 1
        depth = np.sort(
            np.minimum.accumulate(inner[:reach, start:stop], axis=0).sum(axis=0, dtype=np.int64)
        )
        low, typical, high = depth[[len(depth) // 8, len(depth) // 2, 7 * len(depth) // 8]].tolist()
        if typical < reach and (stop - start) * low > ALONG * typical * high:
            left = 0 if start == 0 else start + size
            right = framed_mask.shape[1] if stop == inner.shape[1] else stop + size
            framed_mask[:size, left:right] = 0
