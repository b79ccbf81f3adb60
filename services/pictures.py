"""What an uploaded picture is, from its header alone: nothing is decoded, so a bomb stays small.

Sizes are those of the upright picture, as OpenCV decodes it in the workers: an EXIF orientation counts
for JPEG, PNG and WebP, and Pillow has already applied it to the size of a TIFF.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from PIL import ExifTags, Image

FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "BMP")
_PNG_SIGNATURE_BYTES = 8
_TRANSPOSED = range(5, 9)
"""EXIF orientations that swap width and height."""


class PictureError(ValueError):
    """The bytes are no picture that can be worked on."""


@dataclass(frozen=True)
class Size:
    """Of the upright picture, in pixels."""

    width: int
    height: int


def inspect(data: bytes, *, max_pixels: int) -> Size:
    """Check that ``data`` is a whole picture of a known format and at most ``max_pixels``.

    Raises:
        PictureError: with a message for the one who sent it.
    """
    if not data:
        raise PictureError("is empty")
    format_name, width, height, orientation = _header(data)
    if width * height > max_pixels:
        raise PictureError(f"has {width} x {height} pixels; the limit is {max_pixels} pixels")
    if format_name == "PNG":
        orientation = _png_orientation(_check_png(data))
    elif format_name == "JPEG":
        _check_jpeg(data)
    return Size(height, width) if orientation in _TRANSPOSED else Size(width, height)


def _header(data: bytes) -> tuple[str, int, int, int]:
    """Format, width, height and EXIF orientation (1 where :func:`inspect` reads it itself)."""
    try:
        with Image.open(io.BytesIO(data), formats=FORMATS) as image:
            name = "JPEG" if image.format == "MPO" else str(image.format)
            orientation = image.getexif().get(ExifTags.Base.Orientation, 1) if name in ("JPEG", "WEBP") else 1
            return name, image.width, image.height, orientation
    except Image.DecompressionBombError as error:
        raise PictureError("has far too many pixels") from error
    except Exception as error:  # Pillow's parsers raise anything at all on hostile bytes
        raise PictureError(f"is not a readable picture ({', '.join(FORMATS)})") from error


def _check_jpeg(data: bytes) -> None:
    """Neither marker can stand inside compressed data: a whole file has its end after its last scan began."""
    if data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise PictureError("is a truncated JPEG: its end is missing")


def _check_png(data: bytes) -> bytes:
    """Read every chunk up to the last; return the EXIF data, wherever it stands."""
    exif = b""
    for kind, content in _png_chunks(data):
        if kind == b"eXIf":
            exif = bytes(content)
        if kind == b"IEND":
            return exif
    raise PictureError("is a truncated PNG: its end is missing")


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, memoryview]]:
    view = memoryview(data)
    at = _PNG_SIGNATURE_BYTES
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 8 + length
        if end + 4 > len(data):
            return
        if zlib.crc32(view[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            raise PictureError("is a damaged PNG: a checksum is wrong")
        yield kind, view[at + 8 : end]
        at = end + 4


def _png_orientation(exif_data: bytes) -> int:
    exif = Image.Exif()
    try:
        exif.load(exif_data)
        return int(exif.get(ExifTags.Base.Orientation, 1))
    except Exception:  # as above; an unreadable orientation is none, as for the decoder
        return 1
