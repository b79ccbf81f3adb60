"""Bytes to arrays and back; the only place where pictures are decoded."""

from __future__ import annotations

import io
import warnings

import cv2
import numpy as np
from dlo_client.contracts import ImageSource
from dlo_client.contracts.images import ImageRef
from numpy.typing import NDArray
from PIL import Image, ImageOps

from workers.blobs import BlobMissing
from workers.stages.outcome import InvalidInput, Tools

_WIDE_GRAY = ("I;16", "I;16B", "I;16L", "I")


def read_rgb(source: ImageSource, field: str, tools: Tools) -> NDArray[np.uint8]:
    """The upright picture (H, W, 3). Transparency is dropped, 16-bit gray keeps its upper byte.

    Raises InvalidInput naming ``field``.
    """
    picture = _decode(source, field, tools)
    if picture.mode in _WIDE_GRAY:
        gray = (np.asarray(picture).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8)
        return np.ascontiguousarray(np.repeat(gray[:, :, None], 3, axis=2))
    return np.asarray(picture.convert("RGB"))


def read_mask(source: ImageSource, field: str, tools: Tools) -> NDArray[np.float32]:
    """Foreground probability (H, W) from a picture with 0 to 255, or one with only 0 and 1."""
    picture = _decode(source, field, tools)
    wide = picture.mode in _WIDE_GRAY
    values = np.asarray(picture if wide else picture.convert("L")).astype(np.float32)
    full = 1.0 if values.max() <= 1 else 65535.0 if wide else 255.0
    return np.asarray(np.clip(values / full, 0.0, 1.0), np.float32)


def read_depth_m(source: ImageSource, field: str, tools: Tools) -> NDArray[np.float32]:
    """Distance to the camera (H, W) in meters from 16-bit gray in millimeters; 0 is unknown.

    Raises InvalidInput naming ``field``, also for a picture of 8 bits or of colors.
    """
    picture = _decode(source, field, tools)
    if picture.mode not in _WIDE_GRAY:
        raise InvalidInput(field, "should be 16-bit gray, in millimeters", "invalid_depth")
    return np.asarray(picture).astype(np.float32) / 1000.0


def png(array: NDArray[np.uint8]) -> bytes:
    """(H, W) gray or (H, W, 3) RGB."""
    pixels = cv2.cvtColor(array, cv2.COLOR_RGB2BGR) if array.ndim == 3 else array
    done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not done:
        raise RuntimeError("PNG encoding failed")
    return data.tobytes()


def indexed_png(labels: NDArray[np.uint8], palette: NDArray[np.uint8]) -> bytes:
    """(H, W) indices with ``palette`` (256, 3)."""
    picture = Image.fromarray(labels, "P")
    picture.putpalette(palette.tobytes())
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", compress_level=3)
    return buffer.getvalue()


def _decode(source: ImageSource, field: str, tools: Tools) -> Image.Image:
    if not isinstance(source, ImageRef):
        raise TypeError("the service resolves parts to ids before it enqueues")
    try:
        data = tools.blobs.get(source.id)
    except BlobMissing as error:
        raise InvalidInput(field, "its bytes have expired: upload it again", "unknown_image") from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data))
            if picture.width * picture.height > tools.max_image_pixels:
                raise InvalidInput(field, f"{picture.width} × {picture.height} pixels are too many")
            picture.load()
            return ImageOps.exif_transpose(picture)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InvalidInput(field, f"cannot be decoded: {error}") from error
