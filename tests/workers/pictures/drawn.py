"""Curves drawn for the gate, and encoders for every kind of file that people send."""

from __future__ import annotations

import io
import struct
import zlib

import cv2
import numpy as np
from PIL import Image

from workers.pictures.decoding import Samples, decode

MOST = 64_000_000


def curve(seed: int = 0, width: int = 9, size: tuple[int, int] = (120, 160)) -> np.ndarray:
    """(H, W) bool: a random smooth curve from left to right, inside the picture."""
    random = np.random.default_rng(seed)
    height, wide = size
    x = np.linspace(0.12 * wide, 0.88 * wide, 60)
    phase, slope = random.uniform(0, 6.28), random.uniform(-0.15, 0.15)
    y = height * (
        0.5 + 0.18 * np.sin(random.uniform(4, 7) * x / wide + phase) + slope * (x / wide - 0.5)
    )
    drawn = np.zeros(size, np.uint8)
    cv2.polylines(drawn, [np.rint(np.stack([x, y], 1)).astype(np.int32)], False, 1, width)
    return drawn.astype(bool)


def crossed(width: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Two (120, 160) bool curves that cross once."""
    one, two = np.zeros((2, 120, 160), np.uint8)
    cv2.line(one, (15, 15), (145, 105), 1, width)
    cv2.line(two, (15, 105), (145, 15), 1, width)
    return one.astype(bool), two.astype(bool)


def saved(array: np.ndarray | Image.Image, form: str = "PNG", **options: object) -> bytes:
    image = array if isinstance(array, Image.Image) else Image.fromarray(array)
    buffer = io.BytesIO()
    image.save(buffer, form, **options)
    return buffer.getvalue()


def coded(array: np.ndarray, suffix: str = ".png") -> bytes:
    """By OpenCV, which writes 16 bits a sample of color."""
    done, data = cv2.imencode(suffix, array)
    assert done
    return data.tobytes()


def indexed(indices: np.ndarray, colors: list[tuple[int, int, int]]) -> Image.Image:
    image = Image.fromarray(indices.astype(np.uint8), "P")
    image.putpalette([value for color in colors for value in color])
    return image


def smooth(mask: np.ndarray) -> np.ndarray:
    """(H, W) 0 to 1 with soft outlines, as drawing programs make them."""
    return cv2.GaussianBlur(mask.astype(np.float32), (3, 3), 0.8)


def read(data: bytes) -> Samples:
    return decode(data, max_pixels=MOST)


def photograph(seed: int = 0, size: tuple[int, int] = (120, 160)) -> np.ndarray:
    """(H, W, 3): a gray cable on a shaded brown ground with noise."""
    random = np.random.default_rng(seed)
    shade = np.linspace(90, 170, size[1])[None, :, None] * np.array([1.0, 0.85, 0.6])
    picture = np.broadcast_to(shade, (*size, 3)).copy()
    picture[curve(seed, size=size)] = (60, 62, 70)
    return np.clip(picture + random.normal(0, 4, picture.shape), 0, 255).astype(np.uint8)


def png_chunk(kind: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )
