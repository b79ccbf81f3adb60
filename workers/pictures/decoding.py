"""Bytes to samples: upright, with the depth that the file has."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps

from workers.pictures import headers, jpeg
from workers.pictures.headers import PictureError

Values = NDArray[Any]
"""(H, W) or (H, W, 3), of uint8, uint16, int32 or float32."""

_WHITE_IS_ZERO, _PHOTOMETRIC = 0, 262
_CONVERTED = {
    "1": "L",
    "CMYK": "RGB",
    "YCbCr": "RGB",
    "RGBX": "RGB",
    "RGBa": "RGBA",
    "La": "LA",
    "PA": "RGBA",
}
_PLAIN = {"L", "RGB", "P", "LA", "RGBA"}
_WIDE = {"I;16", "I;16L", "I;16B", "I;16N", "I", "F"}


@dataclass(frozen=True)
class Samples:
    """An upright picture as its file holds it.

    ``values``: gray or RGB, finite and not negative. ``alpha``: (H, W) where there is transparency
    that differs from place to place. ``indices``: (H, W) into a palette, whose colors ``values``
    holds. ``lossy``: compression may have changed every value. ``remarks`` for the one who sent it.
    """

    values: Values
    alpha: NDArray[np.uint8] | None
    indices: NDArray[np.uint8] | None
    lossy: bool
    remarks: tuple[str, ...] = ()

    @property
    def wide(self) -> bool:
        """More than 8 bits a sample."""
        return self.values.dtype != np.uint8


def decode(data: bytes, *, max_pixels: int, holes: bool = False) -> Samples:
    """``holes``: values that are not finite, or below 0, are taken for 0. Raises PictureError with
    a message that continues the name of a field."""
    with headers.opened(data) as picture:
        headers.check_size(picture.size, max_pixels)
        page, sizes = picture.tell(), headers.pages(picture)
        with _as_picture_error():
            picture.seek(page)
            deep = _deep_color(picture, data, page)
            picture.load()
            if picture.format in ("JPEG", "MPO") and not jpeg.is_whole(data, picture):
                raise PictureError("is a truncated JPEG: a part of the picture is missing")
            samples = _samples(picture, deep, holes)
    if len(sizes) > 1:
        samples = replace(samples, remarks=(*samples.remarks, _other_pages(page, sizes)))
    return samples


@contextmanager
def _as_picture_error() -> Iterator[None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except PictureError:
        raise
    except (MemoryError, RecursionError):
        raise
    except Exception as error:  # Pillow's decoders raise anything at all on hostile bytes
        raise PictureError(f"cannot be decoded: {error or type(error).__name__}") from error


def _other_pages(page: int, sizes: list[tuple[int, int]]) -> str:
    if len(set(sizes)) > 1:
        width, height = sizes[page]
        return f"has {len(sizes)} pages; only page {page + 1}, the largest ({width} x {height}), was looked at"
    return f"has {len(sizes)} pages or frames; only the first was looked at"


def _samples(picture: Image.Image, deep: Values | None, holes: bool) -> Samples:
    lossy = picture.format in ("JPEG", "MPO") or (
        picture.format == "WEBP" and not _is_lossless(picture)
    )
    mode, negative = picture.mode, _white_is_zero(picture)
    if mode not in _PLAIN | _WIDE | _CONVERTED.keys():
        raise PictureError(
            f"is in the color space {mode}, which is not read here: send gray or RGB"
        )
    if mode in _WIDE or deep is not None:
        ImageOps.exif_transpose(picture, in_place=True)
        values = _checked(np.asarray(picture) if deep is None else deep, holes)
        return Samples(_without_sign(values, negative), None, None, lossy)
    ImageOps.exif_transpose(picture, in_place=True)
    indices = np.asarray(picture) if mode == "P" else None
    if mode in _CONVERTED:
        picture = picture.convert(_CONVERTED[mode])
    if picture.has_transparency_data:
        picture = picture.convert("RGBA")
    elif picture.mode == "P":
        picture = picture.convert("RGB")
    array = np.asarray(picture)
    return Samples(
        _gray_if_equal(array[:, :, :3] if array.ndim == 3 else array), _alpha(array), indices, lossy
    )


def _alpha(array: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
    """The last plane of (H, W, 2) or (H, W, 4), unless it is the same everywhere."""
    if array.ndim == 2 or array.shape[2] == 3:
        return None
    alpha = array[:, :, -1]
    return None if alpha.min() == alpha.max() else np.ascontiguousarray(alpha)


def _gray_if_equal(values: Values) -> Values:
    """(H, W) where all planes are equal."""
    if values.ndim == 2 or (values.shape[2] == 1):
        return values.reshape(values.shape[:2])
    first = values[:, :, 0]
    rows = slice(None, None, max(1, len(first) // 16))
    for part in (rows, slice(None)):  # most color pictures differ in a few rows already
        if any(
            not np.array_equal(first[part], values[part, :, k]) for k in range(1, values.shape[2])
        ):
            return values
    return np.ascontiguousarray(first)


def _deep_color(picture: Image.Image, data: bytes, page: int) -> Values | None:
    """(H, W, 3), (H, W) upright of a color picture with 16 bits a sample, of which Pillow keeps 8;
    else None."""
    tiles = getattr(picture, "tile", [])
    if picture.mode in _WIDE or page > 0 or not any(";16" in str(tile.args) for tile in tiles):
        return None
    raw = np.frombuffer(data, np.uint8)
    array = cv2.imdecode(raw, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    if array is None or array.dtype != np.uint16 or array.ndim != 3 or array.shape[2] < 3:
        return None
    upright = _upright(array[:, :, 2::-1], _orientation(picture))
    return _gray_if_equal(upright) if sorted(upright.shape[:2]) == sorted(picture.size) else None


def _orientation(picture: Image.Image) -> int:
    return int(picture.getexif().get(ExifTags.Base.Orientation, 1))


def _upright(array: Values, orientation: int) -> Values:
    """Turned and mirrored as the EXIF orientation (1 to 8) requires."""
    if orientation in (5, 6, 7, 8):
        array = array.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        array = array[::-1]
    if orientation in (2, 3, 6, 7):
        array = array[:, ::-1]
    return np.ascontiguousarray(array)


def _white_is_zero(picture: Image.Image) -> bool:
    tags = getattr(picture, "tag_v2", {})
    return picture.format == "TIFF" and tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO


def _without_sign(values: Values, white_is_zero: bool) -> Values:
    """Pillow turns light and dark itself where a TIFF of 8 bits has 0 for white."""
    if not white_is_zero:
        return values
    full: float = 1.0 if values.dtype == np.float32 else int(np.iinfo(values.dtype).max)
    return np.asarray(full - values, values.dtype)


def _checked(values: Values, holes: bool) -> Values:
    if holes:
        values = np.where(np.isfinite(values) & (values > 0), values, 0).astype(values.dtype)
    if values.dtype == np.float32 and not np.isfinite(values).all():
        raise PictureError("has values that are not finite")
    if values.min() < 0:
        raise PictureError(f"has negative values, down to {values.min():g}: send 0 or more")
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _is_lossless(picture: Image.Image) -> bool:
    """Of a WebP, which names its compression in the file."""
    stream = getattr(picture, "fp", None)
    if stream is None:
        return False
    stream.seek(0)
    return bool(b"VP8L" in stream.read(4096))
