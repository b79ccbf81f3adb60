"""Organised point clouds: a point for every pixel of a picture, as depth cameras publish them.

Read are NumPy arrays (NPY) of floats, (H, W, 3), and PCD files with a height above 1 and fields x,
y, z of floats.
"""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from workers.pictures.headers import PictureError, Size, check_size

Points = NDArray[np.float32]

_NPY, _PCD = b"\x93NUMPY", (b"# .PCD", b"VERSION", b"FIELDS")
_MOST_HEADER_BYTES = 10_000
_TYPES = {("F", 4): "<f4", ("F", 8): "<f8", **{("I", n): f"<i{n}" for n in (1, 2, 4, 8)}} | {
    ("U", n): f"<u{n}" for n in (1, 2, 4, 8)
}
_MOST_COUNT = 1000


def is_cloud(data: bytes) -> bool:
    """Whether it begins as one of the formats."""
    return data.startswith(_NPY) or data.startswith(_PCD)


def size_of(data: bytes, max_pixels: int) -> Size:
    """Of the grid, from the header alone. Raises PictureError."""
    height, width = _npy_shape(data)[0] if data.startswith(_NPY) else _header(data).shape
    check_size((width, height), max_pixels)
    return Size(width, height)


def points_of(data: bytes, max_pixels: int) -> Points:
    """(H, W, 3) meters as they are in the file. Raises PictureError."""
    size_of(data, max_pixels)
    return _of_npy(data) if data.startswith(_NPY) else _of_pcd(data)


def _npy_shape(data: bytes) -> tuple[tuple[int, int], np.dtype[Any]]:
    stream = io.BytesIO(data)
    try:
        version = npy.read_magic(stream)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read(stream, max_header_size=_MOST_HEADER_BYTES)
    except Exception as error:  # NumPy's parser raises several types on damaged headers
        raise PictureError("is a damaged NumPy array") from error
    if len(shape) != 3 or shape[2] != 3 or dtype.kind != "f" or min(shape) < 1:
        form = f"{dtype.name} of {' × '.join(map(str, shape))}"
        raise PictureError(
            f"is a NumPy array ({form}); a point cloud is one of floats, height × width × 3"
        )
    return (int(shape[0]), int(shape[1])), dtype


def _of_npy(data: bytes) -> Points:
    try:
        values = np.load(io.BytesIO(data), allow_pickle=False)
    except ValueError as error:
        raise PictureError("is a truncated NumPy array") from error
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, np.float32)


class _Header(NamedTuple):
    """``shape`` (height, width); ``fields`` by name, a record's ``dtype``; ``form`` ascii or
    binary; ``start`` of the points."""

    shape: tuple[int, int]
    dtype: np.dtype[Any]
    form: str
    start: int


def _header(data: bytes) -> _Header:
    lines: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in lines:
        end = data.find(b"\n", start, _MOST_HEADER_BYTES)
        if end < 0:
            raise PictureError("is a damaged PCD file: its header has no end")
        name, *values = data[start:end].decode("ascii", "replace").split() or ["#"]
        lines[name] = values
        start = end + 1
    try:
        shape = int(lines["HEIGHT"][0]), int(lines["WIDTH"][0])
        dtype = _record(lines)
        form = lines["DATA"][0]
    except PictureError:
        raise
    except (KeyError, IndexError, ValueError) as error:
        raise PictureError("is a damaged PCD file: its header is incomplete") from error
    if min(shape) < 2:
        raise PictureError(
            "is a point cloud without rows (HEIGHT 1): there should be a point for each pixel"
        )
    if form not in ("ascii", "binary"):
        raise PictureError(f"is a PCD file of {form[:40]} data: save it as binary or ascii")
    return _Header(shape, dtype, form, start)


def _record(lines: dict[str, list[str]]) -> np.dtype[Any]:
    """Of one point. Raises PictureError where there are no x, y, z of floats, else ValueError or
    KeyError."""
    names, sizes, kinds = lines["FIELDS"], lines["SIZE"], lines["TYPE"]
    counts = [int(n) for n in lines.get("COUNT", ["1"] * len(names))]
    if not all(0 < n <= _MOST_COUNT for n in counts):
        raise ValueError("counts are small")
    parts = list(zip(names, kinds, map(int, sizes), counts, strict=True))
    if not {(name, "F", 1) for name in "xyz"} <= {
        (name, kind, count) for name, kind, _, count in parts
    }:
        raise PictureError("is a PCD file without the fields x, y, z of floats")
    return np.dtype(
        [
            (f"{k} {name}" if name not in "xyz" else name, _TYPES[kind, size], (count,))
            for k, (name, kind, size, count) in enumerate(parts)
        ]
    )


def _of_pcd(data: bytes) -> Points:
    header = _header(data)
    count = header.shape[0] * header.shape[1]
    if header.form == "binary":
        if len(data) - header.start < count * header.dtype.itemsize:
            raise PictureError("is a truncated PCD file")
        record = np.frombuffer(data, header.dtype, count, header.start)
        columns = [record[name][:, 0] for name in "xyz"]
    else:
        columns = _of_text(data, header, count)
    with np.errstate(over="ignore"):
        return np.stack(columns, axis=-1).astype(np.float32).reshape(*header.shape, 3)


def _of_text(data: bytes, header: _Header, count: int) -> list[NDArray[Any]]:
    names = header.dtype.names or ()
    widths = [int(np.prod(header.dtype[name].shape)) for name in names]
    words = data[header.start :].split()
    if len(words) != count * sum(widths):
        raise PictureError(f"is a PCD file with {len(words)} numbers, not {count} × {sum(widths)}")
    first = dict(zip(names, np.cumsum([0, *widths[:-1]]).tolist(), strict=True))
    try:
        return [np.array(words[first[name] :: sum(widths)], float) for name in "xyz"]
    except ValueError as error:
        raise PictureError("is a PCD file in which something is no number") from error
