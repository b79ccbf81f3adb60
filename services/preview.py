"""A picture small enough to look at, for browsers that cannot decode it themselves (TIFF, 16 bits).

Decoding is done in a process of its own, with a limit on its memory: a hostile file harms nobody
else.
"""

from __future__ import annotations

import io
import resource
from typing import cast

from anyio import CapacityLimiter, to_process
from PIL import Image, ImageOps

from workers.pictures import headers
from workers.pictures.headers import PictureError

MEDIA_TYPE = "image/png"
LONGEST_PX = 2048
"""Of the preview's sides."""

_AT_ONCE = 1
_MEMORY_BYTES = 2 * 1024**3
_WIDE = ("I;16", "I;16B", "I;16L", "I", "F")


class Previews:
    """Makes one preview at a time."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(_AT_ONCE)

    async def of(self, data: bytes) -> bytes:
        """PNG of the upright picture, of 8 bits, at most ``LONGEST_PX`` wide and high; raises
        PictureError."""
        async with self._limiter:
            return await to_process.run_sync(_limited_preview, data, cancellable=True)


def preview(data: bytes) -> bytes:
    """See :meth:`Previews.of`."""
    try:
        with headers.opened(data) as image:
            shown = _eight_bits(ImageOps.exif_transpose(image))
            shown.thumbnail((LONGEST_PX, LONGEST_PX))
            buffer = io.BytesIO()
            shown.save(buffer, "PNG", compress_level=1, exif=b"")
            return buffer.getvalue()
    except Exception as error:  # Pillow's decoders raise anything at all on hostile bytes
        raise PictureError("cannot be decoded") from error


def _limited_preview(data: bytes) -> bytes:
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, resource.RLIM_INFINITY))
    return preview(data)


def _eight_bits(image: Image.Image) -> Image.Image:
    """RGB; gray of more bits, often 10 or 12 of 16, is scaled by the power of two above its
    maximum, floats by 1."""
    if image.mode not in _WIDE:
        return image.convert("RGB")
    wide = image.convert("F")
    _, highest = cast(tuple[float, float], wide.getextrema())
    full = (
        1.0
        if image.mode == "F" and highest <= 1
        else max(255.0, 2.0 ** int(highest).bit_length() - 1)
    )
    return wide.point(lambda value: value * (255.0 / full) + 0.0).convert("L").convert("RGB")
