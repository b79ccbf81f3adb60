"""Arrays to what travels: files, points, and which networks took part."""

from __future__ import annotations

import io

import cv2
import numpy as np
from dlo_client.contracts import ModelUsed, Point
from numpy.typing import NDArray
from PIL import Image

from models.weights.inference import NetworkSpec

File = tuple[str, bytes]
"""Media type and contents."""

OVERLAY_SIDE = 1280
"""Longest side of a picture for people: at full size those of large photographs took longer than
the job."""
_QUICK = 1
_DECIMALS = 2
_PNG = "image/png"


def png(array: NDArray[np.uint8], compression: int = 3) -> File:
    """(H, W) gray or (H, W, 3) RGB."""
    pixels = cv2.cvtColor(array, cv2.COLOR_RGB2BGR) if array.ndim == 3 else array
    done, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not done:
        raise RuntimeError("PNG encoding failed")
    return _PNG, data.tobytes()


def overlay_png(picture: NDArray[np.uint8]) -> File:
    """(H, W, 3) RGB for people, reduced by a whole number to ``OVERLAY_SIDE``."""
    factor = -(-max(picture.shape[:2]) // OVERLAY_SIDE)
    if factor > 1:
        height, width = (max(1, side // factor) for side in picture.shape[:2])
        part = picture[: height * factor, : width * factor]
        picture = np.asarray(
            cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.uint8
        )
    return png(picture, _QUICK)


def indexed_png(labels: NDArray[np.uint8], palette: NDArray[np.uint8]) -> File:
    """(H, W) indices with ``palette`` (256, 3)."""
    picture = Image.fromarray(labels, "P")
    picture.putpalette(palette.tobytes())
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", compress_level=3)
    return _PNG, buffer.getvalue()


def mask_png(probability: NDArray[np.float32]) -> File:
    """(H, W) probability × 255."""
    return png(np.rint(probability * 255).astype(np.uint8))


def model_used(spec: NetworkSpec) -> ModelUsed:
    return ModelUsed(name=spec.name, version=spec.version, sha256=spec.sha256[:12])


def as_point(xy: tuple[float, float]) -> Point:
    return round(float(xy[0]), _DECIMALS), round(float(xy[1]), _DECIMALS)


def as_points(xy: NDArray[np.float64]) -> list[Point]:
    """(N, 2) to a list of N."""
    return [(x, y) for x, y in np.round(xy, _DECIMALS).tolist()]
