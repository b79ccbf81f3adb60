"""Pictures in whatever form a caller has them, as the bytes that travel.

============================  =====================================================================
``bytes``, ``bytearray``, …   sent as they are
``str``, ``Path``             the file of that name
``http://…``, ``https://…``   what that address of your own gives to this program, not to the service
open binary file, ``BytesIO`` what it holds from its position on
PIL image                     its pixels as a PNG, as they are in memory: EXIF does not turn them
NumPy array, tensor, …        its pixels as a PNG, see :func:`dlo_client.arrays.png_of_array`; of OpenCV
                              ``opencv(array)``: its channels are in the order B, G, R. As ``depth``
                              also a point cloud: floats (H, W, 3)
several of these              a list, a tuple, a generator
============================  =====================================================================

Everything else is an InvalidArgument that names the argument; a file that cannot be read is an
OSError.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable, Mapping, Set
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeGuard, cast

import httpx

from dlo_client.arrays import bytes_of_array, png_of_array
from dlo_client.errors import InvalidArgument


class BinaryFile(Protocol):
    """What is read from: an open file, ``BytesIO``, a member of an archive."""

    def read(self) -> bytes: ...


class HasPixels(Protocol):
    """A NumPy array or a PIL image."""

    @property
    def __array_interface__(self) -> Any: ...


class ArrayLike(Protocol):
    """What NumPy can make an array of, such as a tensor in main memory."""

    def __array__(self, *args: Any, **more: Any) -> Any: ...


Picture = (
    bytes | bytearray | memoryview | str | os.PathLike[str] | BinaryFile | HasPixels | ArrayLike
)
Pictures = Picture | Iterable[Picture]

_ADDRESSES = ("http://", "https://")
_FETCH_S = 20.0
_PNG_MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I;16")


class Part(NamedTuple):
    """One part of a multipart body: a name for logs, and the encoded picture."""

    name: str
    data: bytes


def part_of(picture: Picture, argument: str) -> Part:
    """One picture, called ``argument`` in errors. Raises InvalidArgument, or OSError for a file."""
    name = "picture"
    if isinstance(picture, bytes | bytearray | memoryview):
        data = bytes(picture)
    elif isinstance(picture, str) and picture.startswith(_ADDRESSES):
        name, data = _fetched(picture, argument)
    elif isinstance(picture, str | os.PathLike):
        name, data = _file(picture, argument)
    elif _is_image(picture):
        data = _png_of_image(picture, argument)
    elif _is_array(picture):
        data = bytes_of_array(picture, argument)
    elif hasattr(picture, "read"):
        data = _rest_of(picture, argument)
    else:
        raise InvalidArgument(
            argument,
            f"{type(picture).__name__} is no picture: give bytes, a path, a file or pixels",
        )
    if not data:
        raise InvalidArgument(argument, "there are no bytes in it")
    return Part(name, data)


def parts_of(pictures: Pictures | None, argument: str) -> list[Part]:
    """One picture, several in order, or none."""
    if pictures is None:
        return []
    unordered = isinstance(pictures, Mapping | Set)
    if _is_one(pictures) or unordered or not isinstance(pictures, Iterable):
        return [part_of(cast(Picture, pictures), argument)]  # what is none is refused there
    several = cast(Iterable[Picture], pictures)
    return [part_of(picture, f"{argument}[{k}]") for k, picture in enumerate(several)]


def _is_one(pictures: Any) -> bool:
    """Files and arrays can be iterated over as well, but are one picture."""
    encoded = isinstance(pictures, bytes | bytearray | memoryview | str | os.PathLike)
    return encoded or _is_array(pictures) or hasattr(pictures, "read")


def _is_array(picture: Any) -> bool:
    kind = type(picture)  # a closed image raises when it is asked itself
    return hasattr(kind, "__array_interface__") or hasattr(kind, "__array__")


def _is_image(picture: Any) -> TypeGuard[Any]:
    """Pillow is not imported for this: who has an image of it has it loaded."""
    pillow = sys.modules.get("PIL.Image")
    return pillow is not None and isinstance(picture, pillow.Image)


def opencv(array: Any) -> Any:
    """A picture as OpenCV holds it, (H, W, 3) B G R or (H, W, 4) B G R A, in the order that is
    sent: a copy.

    Gray pictures are returned as they are.
    """
    shape: Any = getattr(array, "shape", ())
    if len(shape) != 3 or shape[2] not in (3, 4):
        return array
    return array[:, :, [2, 1, 0, 3][: shape[2]]]


def _fetched(address: str, argument: str) -> tuple[str, bytes]:
    """Raises InvalidArgument for an address that gives no picture."""
    try:
        reply = httpx.get(address, timeout=_FETCH_S, follow_redirects=True)
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise InvalidArgument(
            argument, f"{address} cannot be fetched: {error or type(error).__name__}"
        ) from error
    if not reply.is_success:
        raise InvalidArgument(
            argument, f"{address} answers {reply.status_code} {reply.reason_phrase}"
        )
    return "picture", reply.content


def _file(picture: str | os.PathLike[str], argument: str) -> tuple[str, bytes]:
    if not os.fspath(picture):
        raise InvalidArgument(argument, "the path is empty")
    path = Path(picture)
    try:
        data = path.read_bytes()
    except ValueError as error:  # a null character
        raise InvalidArgument(argument, f"{os.fspath(picture)!r} is no path: {error}") from error
    if not data:
        raise InvalidArgument(argument, f"{path} is an empty file")
    return path.name, data


def _rest_of(file: Any, argument: str) -> bytes:
    if isinstance(file, io.TextIOBase):
        raise InvalidArgument(argument, "the file is open as text; open it with 'rb'")
    try:
        data = file.read()
    except (ValueError, TypeError) as error:
        message = f"the file cannot be read; is it closed, or open for writing only? ({error})"
        raise InvalidArgument(argument, message) from error
    if not isinstance(data, bytes | bytearray | memoryview):
        raise InvalidArgument(argument, f"read() gives {type(data).__name__}, not bytes")
    if not data:
        raise InvalidArgument(
            argument, "the file is at its end; seek(0) goes back to its beginning"
        )
    return bytes(data)


def _png_of_image(image: Any, argument: str) -> bytes:
    if image.mode in ("I", "F", "I;16B", "I;16L"):
        return png_of_array(image, argument)
    buffer = io.BytesIO()
    try:
        still = image if image.mode in _PNG_MODES else image.convert("RGB")
        still.save(buffer, "PNG", compress_level=1, exif=b"")
    except Exception as error:  # closed, truncated, of no pixels: Pillow raises several types
        raise InvalidArgument(argument, f"the image cannot be encoded: {error}") from error
    return buffer.getvalue()
