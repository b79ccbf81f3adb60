"""Organised point clouds: what is read of a file, and a PictureError for everything else."""

from __future__ import annotations

import io

import numpy as np
import pytest

from workers.pictures.clouds import is_cloud, points_of, size_of
from workers.pictures.headers import PictureError, Size, inspect

MOST = 10_000
POINTS = np.random.default_rng(0).normal(size=(6, 8, 3)).astype(np.float32)
POINTS[2, 3] = np.nan


def npy(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def pcd(data: str = "binary", points: np.ndarray = POINTS, **changed: str) -> bytes:
    """As PCL writes it, with padding and a color between the coordinates."""
    height, width = points.shape[:2]
    lines = {
        "VERSION": "0.7",
        "FIELDS": "x y z _ rgb normal",
        "SIZE": "4 4 4 1 4 4",
        "TYPE": "F F F U U F",
        "COUNT": "1 1 1 4 1 3",
        "WIDTH": str(width),
        "HEIGHT": str(height),
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(width * height),
        "DATA": data,
    } | changed
    header = "# .PCD v0.7 - Point Cloud Data file format\n" + "".join(
        f"{k} {v}\n" for k, v in lines.items()
    )
    flat = points.reshape(-1, 3)
    if data == "ascii":
        body = "".join(f"{x} {y} {z} 0 0 0 0 16711680 0.5 0.5 nan\n" for x, y, z in flat).encode()
    else:
        record = np.zeros(
            len(flat), [("xyz", "<f4", 3), ("_", "u1", 4), ("rgb", "<u4"), ("normal", "<f4", 3)]
        )
        record["xyz"] = flat
        body = record.tobytes()
    return header.encode() + body


FILES = {
    "NPY": npy(POINTS),
    "doubles": npy(POINTS.astype(">f8")),
    "PCD": pcd(),
    "text": pcd("ascii"),
}


@pytest.mark.parametrize("name", FILES)
def test_points_are_read(name: str) -> None:
    assert is_cloud(FILES[name])
    assert size_of(FILES[name], MOST) == Size(8, 6)
    found = points_of(FILES[name], MOST)
    assert (found.shape, found.dtype) == ((6, 8, 3), np.float32)
    np.testing.assert_allclose(found, POINTS, rtol=1e-6)


def test_a_fortran_array_is_the_right_way_round() -> None:
    np.testing.assert_array_equal(points_of(npy(np.asfortranarray(POINTS)), MOST), POINTS)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (npy(np.zeros((4, 5), np.float32)), "height × width × 3"),
        (npy(np.zeros((4, 5, 3), np.int16)), "of floats"),
        (npy(np.zeros((4, 0, 3))), "height × width × 3"),
        (npy(np.array([{"a": 1}], object)), "of floats"),
        (FILES["NPY"][:-4], "truncated"),
        (b"\x93NUMPY\x01\x00\xff\xff{", "damaged"),
        (pcd(WIDTH="48", HEIGHT="1"), "HEIGHT 1"),
        (pcd("binary_compressed"), "save it as binary"),
        (pcd(FIELDS="a y z _ rgb normal"), "x, y, z of floats"),
        (pcd(TYPE="U F F U U F"), "x, y, z of floats"),
        (pcd(COUNT="1 1 1 -4 1 3"), "incomplete"),
        (pcd(SIZE="4 4 4"), "incomplete"),
        (pcd(WIDTH="many"), "incomplete"),
        (pcd(WIDTH="9"), "truncated"),
        (pcd("ascii", WIDTH="9"), "numbers, not"),
        (pcd("ascii").replace(b"DATA ascii\n", b"DATA ascii\nx"), "no number"),
        (b"VERSION 0.7\n", "no end"),
        (npy(np.zeros((200, 100, 3), np.float32)), "limit"),
        (pcd(WIDTH="100000", HEIGHT="100000"), "limit"),
    ],
)
def test_what_is_none_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(PictureError, match=why):
        points_of(data, MOST)


@pytest.mark.parametrize("name", FILES)
def test_damaged_bytes_raise_nothing_else(name: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(FILES[name])
        for at in rng.integers(0, min(len(data), 300), 3):
            data[at] = rng.integers(256)
        try:
            points = points_of(bytes(data[: rng.integers(1, len(data) + 1)]), MOST)
        except PictureError:
            continue
        assert points.ndim == 3


@pytest.mark.parametrize("name", ["NPY", "PCD"])
def test_a_cloud_as_a_picture_is_told_where_it_belongs(name: str) -> None:
    with pytest.raises(PictureError, match="depth"):
        inspect(FILES[name], max_pixels=MOST)
