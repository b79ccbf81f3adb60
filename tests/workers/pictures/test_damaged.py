"""Damaged, cut and hostile files: an answer or a PictureError, and nothing else."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from tests.workers.pictures import drawn
from tests.workers.pictures.drawn import MOST, png_chunk, saved
from workers.pictures.decoding import decode
from workers.pictures.headers import PictureError, inspect
from workers.pictures.masks import foreground_of
from workers.pictures.photographs import rgb_of
from workers.pictures.two_valued import why_a_mask

PHOTO = drawn.photograph(size=(30, 40))
CURVE = drawn.curve(size=(30, 40), width=3)
FILES = {
    "PNG": saved(PHOTO),
    "palette": saved(drawn.indexed(CURVE, [(0, 0, 0), (255, 0, 0)])),
    "16 bits": saved(PHOTO[:, :, 0].astype(np.uint16) * 200),
    "JPEG": saved(PHOTO, "JPEG"),
    "progressive": saved(PHOTO, "JPEG", progressive=True),
    "TIFF": saved(PHOTO, "TIFF"),
    "pages": saved(
        Image.fromarray(PHOTO),
        "TIFF",
        save_all=True,
        append_images=[Image.fromarray(PHOTO[::2])] * 2,
    ),
    "LZW": saved(PHOTO, "TIFF", compression="tiff_lzw"),
    "floats": saved(PHOTO[:, :, 0].astype(np.float32), "TIFF"),
    "WebP": saved(PHOTO, "WEBP"),
    "GIF": saved(drawn.indexed(CURVE, [(0, 0, 0), (255, 0, 0)]), "GIF"),
    "BMP": saved(PHOTO, "BMP"),
}


def looked_at(data: bytes) -> bool:
    """Whether the whole gate lets it through; whatever it does, it raises nothing but
    PictureError."""
    try:
        size = inspect(data, max_pixels=1_000_000)
        samples = decode(data, max_pixels=1_000_000)
        rgb, _ = rgb_of(samples)
        why_a_mask(samples)
        mask, _ = foreground_of(samples)
    except PictureError:
        return False
    sizes_fit = rgb.shape[:2] == mask.shape == (size.height, size.width)
    return sizes_fit and bool(np.isfinite(mask).all())


def damaged(data: bytes, seed: int) -> bytes:
    """Bytes changed (more of them near the start, where the headers are), cut out, doubled or cut
    off."""
    random = np.random.default_rng(seed)
    changed = bytearray(data)
    for _ in range(int(random.integers(1, 9))):
        reach = len(changed) if random.random() < 0.4 else min(64, len(changed))
        changed[int(random.integers(reach))] = int(
            random.choice([0, 1, 0x7F, 0x80, 0xFF, random.integers(256)])
        )
    at, length = (int(v) for v in random.integers(0, len(changed), 2))
    match seed % 4:
        case 1:
            del changed[at : at + length // 4]
        case 2:
            changed[at:at] = changed[at : at + length // 4]
        case 3:
            del changed[at:]
    return bytes(changed)


@pytest.mark.parametrize("name", FILES)
def test_damaged_files_are_answered_or_refused(name):
    for seed in range(30):
        data = damaged(FILES[name], seed)
        try:
            decode(data, max_pixels=1_000_000)
        except PictureError:
            continue
        looked_at(data)


@pytest.mark.parametrize("name", ["PNG", "JPEG", "progressive", "TIFF", "LZW", "BMP", "GIF"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_files_that_were_cut_off_are_refused(name, share):
    data = FILES[name][: int(share * len(FILES[name]))]
    with pytest.raises(PictureError):
        decode(data, max_pixels=MOST)


@pytest.mark.parametrize("size", [(1, 1), (1, 4000), (4000, 1), (2, 3), (3, 2000)])
def test_strips_and_points_pass_the_gate(size):
    striped = np.zeros(size, np.uint8)
    striped[:: max(2, size[0] // 3), :: max(2, size[1] // 3)] = 255
    for data in (
        saved(striped),
        saved(striped.astype(np.uint16) * 7),
        saved(np.repeat(striped[:, :, None], 3, 2), "JPEG"),
    ):
        samples = decode(data, max_pixels=MOST)
        assert rgb_of(samples)[0].shape == (*size, 3)
        assert inspect(data, max_pixels=MOST).width == size[1]
        looked_at(data)


@pytest.mark.parametrize("bits", [1, 8, 16])
def test_bombs_are_refused_before_they_are_decoded(bits):
    """60 kB that would become 500 megapixels."""
    header = struct.pack(">IIBBBBB", 25_000, 20_000, bits, 0, 0, 0, 0)
    rows = zlib.compress(bytes(1_000_000), 9)
    data = (
        b"\x89PNG\r\n\x1a\n"
        + png_chunk(b"IHDR", header)
        + png_chunk(b"IDAT", rows)
        + png_chunk(b"IEND", b"")
    )
    for look in (inspect, decode):
        with pytest.raises(PictureError, match=r"too many pixels|limit is"):
            look(data, max_pixels=MOST)
