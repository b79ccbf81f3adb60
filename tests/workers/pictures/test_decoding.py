"""Every kind of file to what the networks see, or refused with words."""

import numpy as np
import pytest
from PIL import Image

from tests.workers.pictures import drawn
from tests.workers.pictures.drawn import MOST, coded, read, saved
from workers.pictures.headers import PictureError, Size, inspect
from workers.pictures.photographs import rgb_of

PHOTO = drawn.photograph()
GRAY = PHOTO[:, :, 1]


def shown(data: bytes) -> tuple[np.ndarray, list[str]]:
    return rgb_of(read(data))


@pytest.mark.parametrize(
    ("data", "factor"),
    [
        (saved(GRAY.astype(np.uint16)), 1),
        (saved(GRAY.astype(np.uint16) * 4), 1),
        (saved(GRAY.astype(np.uint16) * 16), 1),
        (saved(GRAY.astype(np.uint16) * 256), 1),
        (saved(GRAY.astype(np.uint16), "TIFF"), 1),
        (saved(GRAY.astype(np.int32) * 1000, "TIFF"), 1000 / 1024),
        (saved(GRAY.astype(np.float32) / 255, "TIFF"), 1),
        (saved(GRAY.astype(np.float32), "TIFF"), 1),
    ],
    ids=[
        "8 in 16",
        "10 in 16",
        "12 in 16",
        "16",
        "TIFF",
        "32 bits",
        "floats to 1",
        "floats to 255",
    ],
)
def test_wide_gray_is_scaled_by_the_power_of_two_above_its_maximum(data, factor):
    """10 and 12 bits in 16, and floats to 1, came out black, and the answer was empty without a
    word."""
    rgb, _ = shown(data)
    assert np.abs(rgb[:, :, 0] - factor * GRAY).max() <= 1


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_wide_color_is_scaled_too(bits, suffix):
    rgb, _ = shown(coded(PHOTO[:, :, ::-1].astype(np.uint16) << bits - 8, suffix))
    assert np.abs(rgb.astype(int) - PHOTO).max() <= 1


def test_a_scaled_picture_says_so():
    assert "1024 was taken as white" in shown(saved(GRAY.astype(np.uint16) * 4))[1][0]
    assert shown(saved(GRAY.astype(np.uint16) * 257))[1] == []


@pytest.mark.parametrize("orientation", range(1, 9))
def test_wide_color_is_turned_upright_as_pillow_turns_it(orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    wanted, _ = shown(saved(PHOTO, exif=exif))
    data = coded(PHOTO[:, :, ::-1].astype(np.uint16) * 257)
    end = len(data) - 12
    data = data[:end] + drawn.png_chunk(b"eXIf", exif.tobytes()[6:]) + data[end:]
    assert np.array_equal(shown(data)[0], wanted)
    assert inspect(data, max_pixels=MOST) == Size(*wanted.shape[1::-1])


def test_a_tiff_whose_white_is_zero_is_turned_round():
    image = Image.fromarray(GRAY.astype(np.uint16) * 257)
    negative = saved(
        Image.fromarray(65535 - GRAY.astype(np.uint16) * 257), "TIFF", tiffinfo={262: 0}
    )
    assert np.abs(shown(negative)[0].astype(int) - shown(saved(image))[0]).max() <= 1


@pytest.mark.parametrize("form", ["TIFF", "GIF", "PNG", "WEBP"])
def test_further_pages_are_counted(form):
    """Only the first page of a TIFF or an animated PNG was looked at, without a word."""
    pages = [Image.fromarray(PHOTO), Image.fromarray(PHOTO[::-1]), Image.fromarray(PHOTO[:, ::-1])]
    rgb, remarks = shown(saved(pages[0], form, save_all=True, append_images=pages[1:]))
    assert rgb.shape == PHOTO.shape
    assert any(
        "has 3 pages or frames; only the first was looked at" in remark for remark in remarks
    )


def test_the_largest_page_of_a_tiff_is_taken():
    small = Image.fromarray(PHOTO[::4, ::4])
    data = saved(small, "TIFF", save_all=True, append_images=[Image.fromarray(PHOTO), small])
    rgb, remarks = shown(data)
    assert np.array_equal(rgb, PHOTO)
    assert "only page 2, the largest (160 x 120)" in remarks[0]
    assert inspect(data, max_pixels=MOST) == Size(160, 120)


def test_a_picture_of_one_color_says_so():
    """An animated PNG whose first frame is blank gave `none_found` and nothing else."""
    assert "nearly one color" in shown(saved(np.full((40, 50, 3), 90, np.uint8)))[1][0]
    lone = np.full((400, 500, 3), 90, np.uint8)
    lone[7, 7] = 255
    assert "nearly one color" in shown(saved(lone))[1][0]
    assert shown(saved(PHOTO))[1] == []


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\0\0\0\x1cftypheic" + bytes(300), "HEIC"),
        (b"\0\0\0\x1cftypavif" + bytes(300), "AVIF"),
        (b"\0\0\0\x1cftypisom" + bytes(300), "video"),
        (b"%PDF-1.7" + bytes(300), "PDF"),
        (b"\n<svg xmlns=''/>", "SVG"),
        (b"PK\x03\x04" + bytes(300), "ZIP"),
        (b"\x93NUMPY" + bytes(300), "NumPy"),
        (b"II*\0" + bytes(300), "TIFF"),
        (b"text", "not a readable picture"),
        (b"", "empty"),
    ],
)
def test_what_is_not_read_is_refused_by_its_name(data, words):
    for look in (inspect, drawn.decode):
        with pytest.raises(PictureError, match=words):
            look(data, max_pixels=MOST)


def test_a_color_space_that_is_not_read_is_named():
    with pytest.raises(PictureError, match="color space LAB"):
        read(saved(Image.new("LAB", (20, 20)), "TIFF"))
