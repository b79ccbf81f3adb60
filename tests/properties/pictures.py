"""Small pictures, ordinary and odd, as bytes: what the generated requests show to the stages."""

from __future__ import annotations

import io

import cv2
import numpy as np
from PIL import Image

SIZE = (96, 72)


def pool() -> dict[str, tuple[bytes, tuple[int, int]]]:
    """PNG bytes and (width, height) by name."""
    made = {
        "cable": _strokes([[(-5, 20), (40, 34), (100, 50)]], 5),
        "two": _strokes([[(-5, 20), (100, 50)], [(20, -5), (60, 80)]], 5),
        "branch": _strokes([[(5, 36), (50, 36)], [(50, 36), (90, 10)], [(50, 36), (90, 62)]], 5),
        "thin": _strokes([[(2, 2), (94, 70)]], 1),
        "thick": _strokes([[(0, 36), (96, 36)]], 40),
        "ring": _ring(),
        "black": np.zeros((SIZE[1], SIZE[0], 3), np.uint8),
        "white": np.full((SIZE[1], SIZE[0], 3), 255, np.uint8),
        "noise": np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8),
        "dot": np.full((1, 1, 3), 255, np.uint8),
        "row": np.full((1, 50, 3), 200, np.uint8),
        "column": np.full((50, 2, 3), 90, np.uint8),
        "checker": np.kron(np.indices((36, 48)).sum(0) % 2 * 255, np.ones((2, 2)))[..., None]
        .repeat(3, 2)
        .astype(np.uint8),
    }
    made |= {
        f"slide{k}": _strokes([[(30 + 5 * k, -5), (44 + 5 * k, 40), (36 + 5 * k, 80)]], 5)
        for k in range(3)
    }
    made |= {f"row{k}": _strokes([[(-5, 34 + k), (100, 36 + k)]], 5) for k in range(3)}
    found = {name: (_png(array), (array.shape[1], array.shape[0])) for name, array in made.items()}
    depth = np.full((SIZE[1], SIZE[0]), 400, np.uint16)
    depth[:, :48] = 0
    found["depth"] = (_png(depth), SIZE)
    found["alpha"] = (_png(np.dstack([made["cable"], made["ring"][:, :, 0]])), SIZE)
    found["mask"] = (_png(np.where(made["branch"][:, :, 0] > 100, 255, 0).astype(np.uint8)), SIZE)
    found["mask_two"] = (_png(np.where(made["two"][:, :, 0] > 100, 1, 0).astype(np.uint8)), SIZE)
    return found


def _strokes(lines: list[list[tuple[int, int]]], width: int) -> np.ndarray:
    picture = np.full((SIZE[1], SIZE[0], 3), 40, np.uint8)
    for line in lines:
        cv2.polylines(picture, [np.array(line, np.int32)], False, (220, 60, 50), width, cv2.LINE_AA)
    return picture


def _ring() -> np.ndarray:
    picture = np.full((SIZE[1], SIZE[0], 3), 40, np.uint8)
    cv2.circle(picture, (48, 36), 22, (220, 60, 50), 5, cv2.LINE_AA)
    return picture


def _png(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(array).save(buffer, "PNG")
    return buffer.getvalue()
