"""Pictures in every form that people send."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from PIL import ExifTags, Image

JSON = {"Content-Type": "application/json"}
"""Headers of a request without pictures."""

TURNED_RIGHT = 6
"""EXIF orientation of a picture that has to be rotated a quarter turn: width and height change
places."""


def pixels(width: int = 40, height: int = 30, mode: str = "RGB") -> Image.Image:
    """A picture with something in it, so that it does not compress to nothing."""
    random = np.random.default_rng(0)
    gray = Image.fromarray(random.integers(0, 256, (height, width), dtype=np.uint8))
    return gray.convert(mode)


def encoded(
    image: Image.Image | None = None, format_name: str = "PNG", orientation: int | None = None
) -> bytes:
    """The bytes of ``image``, by default of :func:`pixels`."""
    buffer = io.BytesIO()
    exif = Image.Exif()
    if orientation:
        exif[ExifTags.Base.Orientation] = orientation
    (image or pixels()).save(buffer, format_name, **({"exif": exif} if orientation else {}))
    return buffer.getvalue()


def sixteen_bit_png() -> bytes:
    values = np.random.default_rng(0).integers(0, 2**16, (30, 40), dtype=np.uint16)
    return encoded(Image.fromarray(values))


def png_chunk(kind: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )


def png_with_late_orientation() -> bytes:
    """Its EXIF chunk stands behind the pixels, where a reader of the header alone does not see
    it."""
    whole = encoded()
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = TURNED_RIGHT
    end = len(whole) - 12
    return whole[:end] + png_chunk(b"eXIf", exif.tobytes()[6:]) + whole[end:]


def jpeg_with_thumbnail() -> bytes:
    """The thumbnail in its EXIF data is a whole JPEG, with an end marker of its own."""
    thumbnail = encoded(pixels(8, 8), "JPEG")
    whole = encoded(format_name="JPEG")
    segment = b"Exif\0\0" + thumbnail
    return whole[:2] + b"\xff\xe1" + struct.pack(">H", 2 + len(segment)) + segment + whole[2:]


def bomb() -> bytes:
    """A PNG of 60 kB that decodes to 500 megapixels."""
    width, height = 25_000, 20_000
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes((1 + width // 8) * height), 9)
    chunks = png_chunk(b"IHDR", header) + png_chunk(b"IDAT", rows) + png_chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


ACCEPTED = {
    "color": encoded(),
    "greyscale": encoded(pixels(mode="L")),
    "RGBA": encoded(pixels(mode="RGBA")),
    "palette": encoded(pixels(mode="P")),
    "16 bit": sixteen_bit_png(),
    "JPEG": encoded(format_name="JPEG"),
    "CMYK JPEG": encoded(pixels(mode="CMYK"), "JPEG"),
    "WebP": encoded(format_name="WEBP"),
    "BMP": encoded(format_name="BMP"),
    "TIFF": encoded(format_name="TIFF"),
    "GIF": encoded(format_name="GIF"),
}
"""All of 40 x 30 pixels."""

REFUSED = {
    "no bytes": b"",
    "zero bytes": bytes(1000),
    "text": b"this is no picture",
    "HEIC": b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(500),
    "truncated JPEG": encoded(format_name="JPEG")[:-100],
    "truncated JPEG with a thumbnail": jpeg_with_thumbnail()[:-100],
    "truncated PNG": encoded()[:-100],
    "PNG without its last bytes": encoded()[:-4],
    "damaged PNG": encoded()[:-20] + b"\0" + encoded()[-19:],
    "PNG header alone": encoded()[:33],
    "bomb": bomb(),
}
