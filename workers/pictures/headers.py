"""What an uploaded picture is, from its header alone: nothing is decoded, so a bomb stays small.

Sizes are those of the upright picture, as the workers decode it.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags, Image

from workers.pictures import jpeg

FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "BMP", "GIF")
_MAX_PAGES = 1000
_PNG_SIGNATURE_BYTES = 8
_TRANSPOSED = range(5, 9)
"""EXIF orientations that swap width and height."""
_OTHERS = {
    b"%PDF": "a PDF document",
    b"<svg": "an SVG drawing",
    b"<?xml": "an XML document",
    b"\xff\x0a": "a JPEG XL picture",
    b"\0\0\0\x0cJXL ": "a JPEG XL picture",
    b"\0\0\0\x0cjP": "a JPEG 2000 picture",
    b"\xff\x4f\xff\x51": "a JPEG 2000 picture",
    b"\x76\x2f\x31\x01": "an OpenEXR picture",
    b"#?RADIANCE": "a Radiance picture",
    b"\x93NUMPY": "a NumPy array (a point cloud comes as `depth`)",
    b"# .PCD": "a point cloud (it comes as `depth`)",
    b"8BPS": "a Photoshop document",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1a\x45\xdf\xa3": "a video",
    b"P5": "a PGM picture",
    b"P6": "a PPM picture",
}
_BRANDS = {
    **dict.fromkeys(
        (b"heic", b"heix", b"heim", b"heis", b"hevc", b"mif1", b"msf1"), "a HEIC picture"
    ),
    **dict.fromkeys((b"avif", b"avis"), "an AVIF picture"),
    b"crx ": "a raw picture",
}


class PictureError(ValueError):
    """The bytes are no picture that can be worked on; the message continues the name of a field."""


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
    with opened(data) as picture:
        check_size(picture.size, max_pixels)
        orientation = _orientation(picture, data)
        width, height = picture.size
        name = picture.format
    if name in ("JPEG", "MPO") and not jpeg.ends(data):
        raise PictureError("is a truncated JPEG: its end is missing")
    return Size(height, width) if orientation in _TRANSPOSED else Size(width, height)


def check_size(size: tuple[int, int], max_pixels: int) -> None:
    """Raises PictureError."""
    width, height = size
    if width * height > max_pixels:
        raise PictureError(f"has {width} x {height} pixels; the limit is {max_pixels} pixels")


@contextmanager
def opened(data: bytes) -> Iterator[Image.Image]:
    """The picture at its largest page, not decoded yet. Raises PictureError."""
    if not data:
        raise PictureError("is empty")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sizes, which are checked here, and of odd tags
            picture = Image.open(io.BytesIO(data), formats=FORMATS)
            picture.seek(_largest_page(picture))
    except Image.DecompressionBombError as error:
        raise PictureError("has far too many pixels") from error
    except Exception as error:  # Pillow's parsers raise anything at all on hostile bytes
        raise PictureError(_unreadable(data)) from error
    with picture:
        yield picture


def pages(picture: Image.Image) -> list[tuple[int, int]]:
    """Sizes of the pages or frames, of the first 1000. A second view behind a JPEG is none. Leaves
    it at the last."""
    if picture.format not in ("TIFF", "PNG", "GIF", "WEBP"):
        return [picture.size]
    if picture.format != "TIFF":
        return [picture.size] * int(getattr(picture, "n_frames", 1))
    sizes = []
    for page in range(_MAX_PAGES):
        try:
            picture.seek(page)
        except EOFError:
            break
        sizes.append(picture.size)
    return sizes


def _largest_page(picture: Image.Image) -> int:
    """Some TIFF files begin with a small copy of the picture."""
    if picture.format != "TIFF":
        return 0
    sizes = pages(picture)
    return max(range(len(sizes)), key=lambda page: (sizes[page][0] * sizes[page][1], -page))


def _unreadable(data: bytes) -> str:
    wanted = f"send {', '.join(FORMATS[:-1])} or {FORMATS[-1]}"
    if data[4:8] == b"ftyp":
        return f"is {_BRANDS.get(data[8:12], 'a video')}, which is not read here: {wanted}"
    start = data[:64].lstrip()
    for head, name in _OTHERS.items():
        if start.startswith(head) or data.startswith(head):
            return f"is {name}, which is not read here: {wanted}"
    if data.startswith((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")):
        return "is a TIFF file whose samples are of a kind that is not read here, or it is damaged"
    return f"is not a readable picture ({', '.join(FORMATS)})"


def _orientation(picture: Image.Image, data: bytes) -> int:
    """Of the EXIF data; Pillow has already applied that of a TIFF to its size."""
    if picture.format == "PNG":
        return _png_orientation(_check_png(data))
    if picture.format not in ("JPEG", "MPO", "WEBP"):
        return 1
    try:
        return int(picture.getexif().get(ExifTags.Base.Orientation, 1))
    except Exception:  # an unreadable orientation is none, as for the decoder
        return 1


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
        value: Any = exif.get(ExifTags.Base.Orientation, 1)
        return int(value)
    except Exception:  # as above
        return 1
