"""Cuts of labelled pictures at any scale and turn, and what a camera could have made of their
colors."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray

Rng = np.random.Generator
UNKNOWN = 128
"""Label of a pixel where one cannot tell; it has no weight in a loss. 255 is cable, 0 is not."""


@dataclass(frozen=True)
class Cut:
    """``size`` (height, width) px of a cut; ``scale`` bounds, drawn evenly on a logarithmic axis;
    ``turn_rad`` spread of the turn."""

    size: tuple[int, int]
    scale: tuple[float, float]
    turn_rad: float


def cut_out(
    image: ByteArray, labels: ByteArray, cut: Cut, rng: Rng, at: FloatArray | None = None
) -> tuple[ByteArray, ByteArray]:
    """(h, w, 3) and (h, w) of the cut around ``at`` (x, y), or anywhere. Beyond the border picture
    and labels are mirrored."""
    height, width = cut.size
    scale = float(np.exp(rng.uniform(*np.log(cut.scale))))
    angle = float(rng.normal(0.0, cut.turn_rad))
    rows, columns = labels.shape
    center = at if at is not None else rng.uniform((0, 0), (columns, rows))
    # A cut that fits stays inside the picture.
    reach = np.array([width, height]) / (2 * scale)
    low, high = (
        np.minimum(reach, [columns / 2, rows / 2]),
        np.maximum([columns, rows] - reach, [columns / 2, rows / 2]),
    )
    center = np.clip(center + rng.uniform(-0.35, 0.35, 2) * reach, low, high)
    flip = rng.random(2) < (0.5, 0.25)
    linear = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    linear = np.where(flip, -1.0, 1.0)[:, None] * linear
    matrix = np.column_stack([linear, np.array([width, height]) / 2 - linear @ center])
    planes = [
        image,
        *(np.where(labels == value, 255, 0).astype(np.uint8) for value in (255, UNKNOWN)),
    ]
    if scale < 0.7:  # averaged before it is reduced, as the network's input is
        planes, matrix = _reduced(planes, matrix, scale)
    picture, cable, unknown = (
        cv2.warpAffine(
            plane,
            matrix,
            (width, height),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT_101,
        )
        for plane in planes
    )
    found = np.where(cable >= 128, 255, 0).astype(np.uint8)
    found[unknown >= 64] = UNKNOWN
    return np.asarray(picture, np.uint8), found


def _reduced(
    planes: list[ByteArray], matrix: FloatArray, scale: float
) -> tuple[list[ByteArray], FloatArray]:
    rows, columns = planes[0].shape[:2]
    size = max(round(columns * scale), 2), max(round(rows * scale), 2)
    factors = np.array([size[0] / columns, size[1] / rows])
    linear = matrix[:, :2] / factors
    shift = matrix[:, 2] + linear @ ((1 - factors) / 2)  # centers of pixels: x' = (x + 0.5) f - 0.5
    smaller = [
        np.asarray(cv2.resize(p, size, interpolation=cv2.INTER_AREA), np.uint8) for p in planes
    ]
    return smaller, np.column_stack([linear, shift])


def recolored(image: ByteArray, rng: Rng) -> ByteArray:
    """Channels swapped, exposure, contrast, tint, saturation, gray, blur and noise, each now and
    then."""
    out = image
    if rng.random() < 0.25:
        out = out[:, :, rng.permutation(3)]
    if rng.random() < 0.8:
        levels = np.arange(256, dtype=np.float32)[:, None] / 255
        gamma = np.exp(rng.normal(0, 0.25) + rng.normal(0, 0.06, 3))
        gain, lift = np.exp(rng.normal(0, 0.2)), rng.normal(0, 0.05)
        table = np.clip(gain * levels**gamma + lift, 0, 1)
        out = np.stack(
            [(table[:, k] * 255).astype(np.uint8)[out[:, :, k]] for k in range(3)], axis=2
        )
    if rng.random() < 0.3:
        gray = cv2.cvtColor(np.ascontiguousarray(out), cv2.COLOR_RGB2GRAY)[:, :, None]
        share = 0.0 if rng.random() < 0.3 else float(rng.uniform(0.3, 1.5))
        out = np.clip(gray + share * (out.astype(np.float32) - gray), 0, 255).astype(np.uint8)
    if rng.random() < 0.15:
        sigma = float(rng.uniform(0.3, 1.2))
        out = np.asarray(cv2.GaussianBlur(np.ascontiguousarray(out), (0, 0), sigma), np.uint8)
    if rng.random() < 0.3:
        noise = rng.standard_normal(out.shape, dtype=np.float32) * rng.uniform(1, 9)
        out = np.clip(out + noise, 0, 255).astype(np.uint8)
    return np.ascontiguousarray(out)
