"""Pictures of a harness with one crossing, drawn by hand, and their depth."""

from __future__ import annotations

import io

import cv2
import numpy as np
from dlo_client.contracts import (
    ImageRef,
)
from PIL import Image

from workers.stages.outcome import Tools


def put(tools: Tools, array: np.ndarray) -> ImageRef:
    buffer = io.BytesIO()
    Image.fromarray(array).save(buffer, "PNG")
    return ImageRef(id=tools.blobs.put(buffer.getvalue()))


def harness_mask() -> np.ndarray:
    """A trunk along y = 120 with a branch at x = 100 that comes back over it near (253, 120)."""
    mask = np.zeros((280, 400), np.uint8)
    cv2.line(mask, (20, 120), (380, 120), 255, 15)
    t = np.linspace(0, 1, 60)[:, None]
    corners = [np.array(p, float) for p in ((100, 120), (95, 320), (250, 260), (270, 30))]
    curve = (
        (1 - t) ** 3 * corners[0]
        + 3 * t * (1 - t) ** 2 * corners[1]
        + 3 * t**2 * (1 - t) * corners[2]
    )
    curve = curve + t**3 * corners[3]
    cv2.polylines(mask, [np.rint(curve).astype(np.int32)], False, 255, 8)
    return mask


def depth_of(upper_branch: bool) -> np.ndarray:
    trunk = np.zeros((280, 400), np.uint8)
    cv2.line(trunk, (20, 120), (380, 120), 255, 15)
    depth = np.where(harness_mask() > 0, 990, 1000).astype(np.uint16)
    depth[trunk > 0] = 980
    if upper_branch:
        branch = (harness_mask() > 0) & (np.arange(400) > 225)[None] & (np.arange(400) < 282)[None]
        branch &= ~((trunk > 0) & ((np.arange(400) < 248) | (np.arange(400) > 259))[None])
        depth[branch] = 960
    return depth
