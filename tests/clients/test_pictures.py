"""What a caller may hand in as a picture, what travels then, and what is refused by name."""

from __future__ import annotations

import http.server
import io
import subprocess
import sys
import threading
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import dlo_client
import numpy as np
import pytest
from dlo_client.errors import DLOError, InvalidArgument
from dlo_client.pictures import opencv, part_of, parts_of
from PIL import ExifTags, Image

RANDOM = np.random.default_rng(3)
COLOR = RANDOM.integers(0, 256, (4, 6, 3), dtype=np.uint8)
SAMPLE = Path(__file__).parent.parent / "samples" / "plain.jpg"


def sent(picture: Any) -> Any:
    """The pixels that the other side decodes: (H, W) or (H, W, C) in RGB order."""
    [part] = parts_of(picture, "image")
    pixels = cv2.imdecode(np.frombuffer(part.data, np.uint8), cv2.IMREAD_UNCHANGED)
    return pixels[:, :, [2, 1, 0, 3][: pixels.shape[2]]] if pixels.ndim == 3 else pixels


class Tensor:
    """An array type that is not NumPy's, as torch's."""

    def __init__(self, values: Any) -> None:
        self._values = values

    def __array__(self, *_: Any, **__: Any) -> Any:
        if self._values is None:
            raise TypeError("copy the tensor to host memory first")
        return self._values


ARRAYS = {
    "color": (COLOR, COLOR),
    "gray": (COLOR[:, :, 0], COLOR[:, :, 0]),
    "gray with a channel": (COLOR[:, :, :1], COLOR[:, :, 0]),
    "with transparency": (np.dstack((COLOR, COLOR[:, :, 0])), np.dstack((COLOR, COLOR[:, :, 0]))),
    "BGR turned round": (COLOR[:, :, ::-1], COLOR[:, :, ::-1]),
    "every second pixel": (COLOR[::2, ::-2], COLOR[::2, ::-2]),
    "one pixel": (COLOR[:1, :1], COLOR[:1, :1]),
    "16 bit": (COLOR[:, :, 0] * np.uint16(257), COLOR[:, :, 0] * np.uint16(257)),
    "16 bit, low": (COLOR[:, :, 0].astype(np.uint16), COLOR[:, :, 0].astype(np.uint16)),
    "16 bit, bytes swapped": (COLOR[:, :, 0].astype(">u2"), COLOR[:, :, 0].astype(np.uint16)),
    "16 bit color": (COLOR * np.uint16(256), COLOR * np.uint16(256)),
    "yes and no": (COLOR[:, :, 0] > 99, 255 * (COLOR[:, :, 0] > 99).astype(np.uint8)),
    "integers": (COLOR.astype(np.int64), COLOR),
    "large integers": (
        COLOR[:, :, 0].astype(np.int32) * 200,
        COLOR[:, :, 0].astype(np.uint16) * 200,
    ),
    "floats of 0 to 1": (COLOR / 255, COLOR),
    "half floats": ((COLOR > 99).astype(np.float16), 255 * (COLOR > 99).astype(np.uint8)),
    "tensor": (Tensor(COLOR), COLOR),
}


@pytest.mark.parametrize(("array", "expected"), ARRAYS.values(), ids=ARRAYS)
def test_an_array_arrives_without_loss(array: Any, expected: Any) -> None:
    """Arrays ended in "the truth value of an array is ambiguous"."""
    got = sent(array)
    assert got.dtype == expected.dtype
    np.testing.assert_array_equal(got, expected)


MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr", "HSV", "LAB", "I;16", "I")


@pytest.mark.parametrize("mode", MODES)
def test_an_image_of_any_mode_arrives(mode: str) -> None:
    gray = Image.fromarray(COLOR[:, :, 0])
    image = Image.fromarray(COLOR[:, :, 0].astype(np.uint16)) if mode == "I;16" else None
    image = image or (
        gray.convert(mode) if mode in ("1", "I") else Image.fromarray(COLOR).convert(mode)
    )
    assert image.mode == mode
    [part] = parts_of(image, "image")
    with Image.open(io.BytesIO(part.data)) as arrived:
        assert arrived.format == "PNG"
        assert arrived.size == (6, 4)
        expected = np.asarray(image if mode in ("I;16", "I") else image.convert("RGB"))
        np.testing.assert_array_equal(
            np.asarray(arrived if mode in ("I;16", "I") else arrived.convert("RGB")), expected
        )


def test_an_image_is_sent_as_it_is_in_memory() -> None:
    """Its EXIF orientation does not travel: answers are in the pixels that the caller holds."""
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    buffer = io.BytesIO()
    Image.fromarray(COLOR).save(buffer, "PNG", exif=exif)
    with Image.open(buffer) as image:
        [part] = parts_of(image, "image")
    with Image.open(io.BytesIO(part.data)) as arrived:
        assert arrived.getexif().get(ExifTags.Base.Orientation) is None
        assert arrived.size == (6, 4)


def test_bytes_paths_and_files_are_sent_as_they_are(tmp_path: Path) -> None:
    data = SAMPLE.read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(SAMPLE, "plain.jpg")
    with (
        SAMPLE.open("rb") as file,
        zipfile.ZipFile(tmp_path / "a.zip") as archive,
        archive.open("plain.jpg") as member,
    ):
        given: list[Any] = [
            data,
            bytearray(data),
            memoryview(data),
            SAMPLE,
            str(SAMPLE),
            file,
            io.BytesIO(data),
            member,
        ]
        parts = parts_of(given, "image")
    assert [part.data for part in parts] == [data] * len(given)
    assert [part.name for part in parts] == ["picture"] * 3 + ["plain.jpg"] * 2 + ["picture"] * 3


def test_several_come_in_any_sequence_and_none_is_none() -> None:
    assert parts_of(None, "image") == []
    assert parts_of([], "image") == []
    for several in (
        [b"a", b"b"],
        (b"a", b"b"),
        (data for data in (b"a", b"b")),
        {b"a": 1, b"b": 2}.keys(),
    ):
        if isinstance(several, list | tuple) or hasattr(several, "send"):
            assert [part.data for part in parts_of(several, "image")] == [b"a", b"b"]
        else:
            with pytest.raises(InvalidArgument, match="no picture"):
                parts_of(several, "image")


def _closed_file() -> Any:
    file = SAMPLE.open("rb")
    file.close()
    return file


def _closed_image() -> Any:
    image = Image.open(SAMPLE)
    image.close()
    return image


def _at_end() -> Any:
    buffer = io.BytesIO()
    Image.fromarray(COLOR).save(buffer, "PNG")
    return buffer


class _Asynchronous:
    async def read(self) -> bytes:
        return b"picture"


REFUSED: dict[str, tuple[Any, str]] = {
    "number": (5, "image: int is no picture"),
    "dictionary": ({"image": b"a"}, "image: dict is no picture"),
    "set": ({b"a"}, "image: set is no picture"),
    "nothing in a list": ([b"a", None], r"image\[1\]: NoneType is no picture"),
    "lists of numbers": ([[1, 2], [3, 4]], r"image\[0\]: list is no picture"),
    "no bytes": (b"", "image: there are no bytes"),
    "empty path": ("", "image: the path is empty"),
    "path with a null": ("a\0b", "image: .* is no path"),
    "text file": (io.StringIO("a"), "open it with 'rb'"),
    "file at its end": (_at_end(), r"seek\(0\)"),
    "closed file": (_closed_file(), "is it closed"),
    "closed image": (_closed_image(), "image: the image cannot be encoded"),
    "image without pixels": (Image.new("RGB", (0, 4)), "image: the image cannot be encoded"),
    "asynchronous file": (_Asynchronous(), "read\\(\\) gives coroutine"),
    "empty array": (np.zeros((0, 5)), r"shape \(0, 5\)"),
    "row": (np.zeros(5), r"shape \(5,\)"),
    "number of NumPy": (np.float64(3), r"shape \(\)"),
    "channels first": (np.zeros((3, 8, 9), np.uint8), "transpose"),
    "batch": (np.zeros((2, 8, 9, 3), np.uint8), r"list\(array\)"),
    "two channels": (np.zeros((8, 9, 2), np.uint8), r"shape \(8, 9, 2\)"),
    "floats to 255": (np.full((3, 3), 255.0), "0 to 1, not 255 to 255"),
    "not a number": (np.full((3, 3), np.nan), "0 to 1, not nan to nan"),
    "float image": (Image.new("F", (3, 3), 7.0), "0 to 1, not 7 to 7"),
    "negative": (np.full((3, 3), -1), "0 to 65535, not -1 to -1"),
    "too large": (np.full((3, 3), 70_000), "not 70000 to 70000"),
    "complex": (np.zeros((3, 3), complex), "complex128 is no picture"),
    "text": (np.array([["a"]]), "is no picture"),
    "tensor elsewhere": (Tensor(None), "copy the tensor to host memory"),
}


@pytest.mark.parametrize(("given", "message"), REFUSED.values(), ids=REFUSED)
@pytest.mark.filterwarnings("ignore:coroutine:RuntimeWarning")
def test_what_is_no_picture_is_refused_by_name(given: Any, message: str) -> None:
    """These ended in AttributeError, TypeError or in a body that the service could not read."""
    with pytest.raises(InvalidArgument, match=message) as caught:
        parts_of(given, "image")
    assert caught.value.argument.startswith("image")
    assert isinstance(caught.value, DLOError)


def test_a_file_that_cannot_be_read_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        parts_of(tmp_path / "nowhere.png", "image")
    with pytest.raises(OSError, match=str(tmp_path)):
        parts_of(tmp_path, "image")


@pytest.mark.slow
def test_pictures_need_neither_numpy_nor_pillow() -> None:
    program = (
        "import sys; sys.modules['numpy'] = sys.modules['PIL'] = None\n"
        "from dlo_client.pictures import opencv, part_of, parts_of\n"
        f"assert parts_of({str(SAMPLE)!r}, 'image')[0].data == parts_of(open({str(SAMPLE)!r}, 'rb'), 'image')[0].data"
    )
    root = Path(dlo_client.__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_an_address_of_the_caller_s_own_is_fetched_by_the_client(tmp_path: Path) -> None:
    """The service fetches nothing: its network is not the caller's."""
    (tmp_path / "a.png").write_bytes(b"a picture")
    serve = partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), serve)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        assert part_of(f"{address}/a.png", "image").data == b"a picture"
        with pytest.raises(InvalidArgument, match="404"):
            part_of(f"{address}/b.png", "image")
    finally:
        server.shutdown()
        server.server_close()
    with pytest.raises(InvalidArgument, match="cannot be fetched"):
        part_of(f"{address}/a.png", "image")


def test_pictures_of_opencv_are_turned_to_rgb() -> None:
    blue = np.zeros((2, 2, 3), np.uint8)
    blue[:, :, 0] = 255
    assert opencv(blue)[0, 0].tolist() == [0, 0, 255]
    with_alpha = np.dstack([blue, np.full((2, 2), 7, np.uint8)])
    assert opencv(with_alpha)[0, 0].tolist() == [0, 0, 255, 7]
    gray = blue[:, :, 0]
    assert opencv(gray) is gray
