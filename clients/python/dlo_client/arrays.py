"""Arrays as pictures, and masks as arrays. NumPy is imported only when one of them is used.

An array is sent as a PNG of 8 or 16 bits without loss. The writer is here because the SDK without
extras has no library that encodes pictures, and none of the usual ones writes color of 16 bits.
"""

from __future__ import annotations

import io
import struct
import zlib
from typing import TYPE_CHECKING, Any

from dlo_client.errors import InvalidArgument

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_COLOR_TYPES = {1: 0, 3: 2, 4: 6}
"""PNG's color type for a number of channels: gray, RGB, RGB with transparency."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_FAST = 1
_DEPTH = "depth"
_LARGEST_8 = 255
_LARGEST_16 = 65_535
_FORMS = "a picture is (H, W), (H, W, 1), (H, W, 3) in RGB order, or (H, W, 4)"


def png_of_array(array: Any, argument: str) -> bytes:
    """PNG of an (H, W) or (H, W, C) array, C 1, 3 (RGB) or 4.

    bool becomes 0 and 255; integers stay what they are, in 8 bits if they fit and else in 16;
    floats of 0 to 1 become 0 to 255. Raises InvalidArgument naming ``argument`` for everything
    else.
    """
    pixels = _pixels(_with_channels(_as_array(array, argument), argument), argument)
    height, width, channels = pixels.shape
    depth = 8 * pixels.itemsize
    header = struct.pack(">IIBBBBB", width, height, depth, _COLOR_TYPES[channels], 0, 0, 0)
    rows = zlib.compress(_filtered(pixels), _FAST)
    return _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", rows) + _chunk(b"IEND", b"")


def bytes_of_array(array: Any, argument: str) -> bytes:
    """An (H, W, 3) array of floats that is a ``depth`` is a point cloud and becomes a file of
    NumPy; every other one a PNG. Raises InvalidArgument naming ``argument``."""
    values = _as_array(array, argument)
    if argument != _DEPTH or values.ndim != 3 or values.shape[2] != 3 or values.dtype.kind != "f":
        return png_of_array(values, argument)
    import numpy as np

    file = io.BytesIO()
    np.save(file, np.asarray(values, np.float32), allow_pickle=False)
    return file.getvalue()


def mask_array(counts: str, size: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) mask of a COCO run-length string. Raises ValueError if the runs do not fill
    ``size``."""
    import numpy as np

    runs = run_lengths(counts)
    height, width = size
    if min(runs, default=0) < 0 or sum(runs) != height * width:
        raise ValueError(f"the runs do not make a mask of {height} x {width} pixels")
    values = np.arange(len(runs)) % 2 == 1
    return np.ascontiguousarray(np.repeat(values, runs).reshape(width, height).T)


def run_lengths(counts: str) -> list[int]:
    """Lengths of the runs, down the columns, background first.

    A number is 5-bit groups, lowest first, in two's complement; bit 6 says that more follow, and 48
    makes it printable. From the fourth run on, the difference to the run two places before is
    stored. Raises ValueError for a string that is none.
    """
    runs: list[int] = []
    value = shift = 0
    for code in counts.encode("ascii", "replace"):
        group = code - 48
        if not 0 <= group < 64:
            raise ValueError("not a compressed run-length string")
        value |= (group & 0x1F) << shift
        shift += 5
        if group & 0x20:
            continue
        if group & 0x10:
            value -= 1 << shift
        runs.append(value + runs[-2] if len(runs) > 2 else value)
        value = shift = 0
    if shift:
        raise ValueError("the run-length string is cut short")
    return runs


def _as_array(array: Any, argument: str) -> NDArray[Any]:
    try:
        import numpy as np
    except ImportError as error:
        raise InvalidArgument(argument, "an array needs NumPy: pip install numpy") from error
    try:
        return np.asarray(array)
    except Exception as error:  # whatever a foreign array type raises, as a tensor on a GPU does
        raise InvalidArgument(
            argument, f"{type(array).__name__} cannot be read as an array: {error}"
        ) from error


def _with_channels(array: NDArray[Any], argument: str) -> NDArray[Any]:
    """(H, W, C)."""
    shape = array.shape
    pixels = array[:, :, None] if array.ndim == 2 else array
    if pixels.ndim == 3 and pixels.shape[2] in _COLOR_TYPES and pixels.size:
        return pixels
    hint = ""
    if len(shape) == 3 and shape[0] in _COLOR_TYPES:
        hint = "; channels come last: array.transpose(1, 2, 0)"
    elif len(shape) == 4:
        hint = "; several pictures are a list of them: list(array)"
    raise InvalidArgument(argument, f"an array of shape {shape} is no picture; {_FORMS}{hint}")


def _pixels(array: NDArray[Any], argument: str) -> NDArray[Any]:
    """As uint8 or uint16."""
    import numpy as np

    match array.dtype.kind:
        case "b":
            return np.where(array, np.uint8(_LARGEST_8), np.uint8(0))
        case "u" | "i":
            low, high = int(array.min()), int(array.max())
            if low < 0 or high > _LARGEST_16:
                raise InvalidArgument(
                    argument, f"integers of a picture are 0 to {_LARGEST_16}, not {low} to {high}"
                )
            sixteen = array.dtype.kind == "u" and array.dtype.itemsize == 2  # in either byte order
            if sixteen or high > _LARGEST_8:
                return array.astype(np.uint16)
            return array.astype(np.uint8)
        case "f":
            if not (np.isfinite(array).all() and array.min() >= 0 and array.max() <= 1):
                span = f"{float(array.min()):g} to {float(array.max()):g}"
                raise InvalidArgument(
                    argument, f"floats of a picture are 0 to 1, not {span}; for 0 to 255 give uint8"
                )
            scaled: NDArray[Any] = np.rint(array * _LARGEST_8)
            return scaled.astype(np.uint8)
    raise InvalidArgument(
        argument, f"an array of {array.dtype} is no picture: give uint8, uint16, bool or float"
    )


def _filtered(pixels: NDArray[Any]) -> bytes:
    """PNG's rows, each the difference to the pixel on its left: photographs shrink more, and as
    fast."""
    import numpy as np

    height, width, channels = pixels.shape
    step = channels * pixels.itemsize
    raw = (
        np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">")))
        .view(np.uint8)
        .reshape(height, -1)
    )
    rows = np.empty((height, 1 + width * step), np.uint8)
    rows[:, 0] = 1
    rows[:, 1 : 1 + step] = raw[:, :step]
    np.subtract(raw[:, step:], raw[:, :-step], out=rows[:, 1 + step :])
    return rows.tobytes()


def _chunk(kind: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )
