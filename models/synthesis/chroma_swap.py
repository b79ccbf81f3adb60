"""A keyed picture before another background: eq. 2.1, and the augmentation of thesis section 2.7.1.

The thesis gives probabilities, not amplitudes, for the background's changes; those here are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Rng = np.random.Generator

_PICTURES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Backgrounds:
    """Pictures by group, drawn with equal chance by group first; read when drawn. ``pack`` holds
    arrays by name, without it the names are files."""

    groups: tuple[tuple[str, ...], ...]
    pack: Path | None = None

    def draw(self, rng: Rng) -> Rgb:
        group = self.groups[rng.integers(len(self.groups))]
        return self._read(group[rng.integers(len(group))])

    def _read(self, name: str) -> Rgb:
        if self.pack is not None:
            with np.load(self.pack) as arrays:
                return np.asarray(arrays[name])
        picture = cv2.imread(name, cv2.IMREAD_COLOR)
        if picture is None:
            raise ValueError(f"background {name} is no readable picture")
        return np.ascontiguousarray(picture[:, :, ::-1])


def open_backgrounds(path: Path) -> Backgrounds:
    """A folder of pictures, with or without sub-folders (each a group), or a pack made by
    ``python -m models.synthesis pack``. ValueError when there is no picture."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            names = [(name.split("/")[0], name) for name in sorted(arrays.files)]
    else:
        files = sorted(f for f in path.rglob("*") if f.suffix.lower() in _PICTURES)
        names = [(str(f.parent), str(f)) for f in files]
    if not names:
        raise ValueError(f"no background pictures in {path}")
    groups: dict[str, list[str]] = {}
    for group, name in names:
        groups.setdefault(group, []).append(name)
    return Backgrounds(
        tuple(tuple(g) for g in groups.values()), path if path.suffix == ".npz" else None
    )


def blend(front: Rgb, behind: Rgb, mask: Mask, sigma: float) -> Rgb:
    """Eq. 2.1 with the Gaussian filter of ``sigma`` px; all (H, W, 3), ``mask`` (H, W)."""
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), sigma)[:, :, None]
    mixed = weight * front + (1 - weight) * behind
    return np.asarray(mixed.round().astype(np.uint8))


def vary_foreground(rgb: Rgb, rng: Rng) -> Rgb:
    """Channels shuffled (p = 0.5), grey (p = 0.1), hue turned by up to ±100 (p = 0.5): units of 2°,
    those of 8-bit pictures, so that every hue is reached and that of the screen is covered too."""
    if rng.random() < 0.5:
        rgb = rgb[:, :, rng.permutation(3)]
    if rng.random() < 0.1:
        rgb = np.repeat(
            cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)[:, :, None], 3, 2
        )
    if rng.random() < 0.5:
        hsv = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2HSV)
        hsv[:, :, 0] = (hsv[:, :, 0].astype(int) + int(rng.integers(-100, 101))) % 180
        rgb = np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB))
    return np.ascontiguousarray(rgb)


def vary_background(rgb: Rgb, size: tuple[int, int], rng: Rng) -> Rgb:
    """Flipped, shifted, scaled and rotated at random, motion blur and elastic transformation (p =
    0.2 each), then a random crop of ``size`` (height, width)."""
    for axis in (0, 1):
        if rng.random() < 0.5:
            rgb = np.flip(rgb, axis)
    height, width = (round(1.25 * side) for side in size)  # room for the crop
    moved = _move(np.ascontiguousarray(rgb), (height, width), rng)
    if rng.random() < 0.2:
        moved = _motion_blur(moved, rng)
    if rng.random() < 0.2:
        moved = _elastic(moved, rng)
    y, x = rng.integers(height - size[0] + 1), rng.integers(width - size[1] + 1)
    return np.ascontiguousarray(moved[y : y + size[0], x : x + size[1]])


def _move(rgb: Rgb, size: tuple[int, int], rng: Rng) -> Rgb:
    h, w = rgb.shape[:2]
    cover = max(size[0] / h, size[1] / w)
    scale = cover * rng.uniform(1.0, 1.6)
    matrix = cv2.getRotationMatrix2D(((w - 1) / 2, (h - 1) / 2), float(rng.uniform(-45, 45)), scale)
    matrix[:, 2] += np.array([size[1] - w, size[0] - h]) / 2 + rng.uniform(-0.1, 0.1, 2) * np.array(
        size[::-1]
    )
    return np.asarray(cv2.warpAffine(rgb, matrix, size[::-1], borderMode=cv2.BORDER_REFLECT_101))


def _motion_blur(rgb: Rgb, rng: Rng) -> Rgb:
    length = int(rng.integers(3, max(5, rgb.shape[1] // 40)))
    line = np.zeros((length, length), np.float32)
    line[length // 2] = 1.0
    center = ((length - 1) / 2, (length - 1) / 2)
    turned = cv2.warpAffine(
        line, cv2.getRotationMatrix2D(center, float(rng.uniform(0, 180)), 1.0), (length, length)
    )
    return np.asarray(cv2.filter2D(rgb, -1, turned / turned.sum()))


def _elastic(rgb: Rgb, rng: Rng) -> Rgb:
    h, w = rgb.shape[:2]
    coarse = rng.normal(0.0, 0.012 * w, (2, 6, 9)).astype(np.float32)
    dx, dy = (cv2.resize(plane, (w, h), interpolation=cv2.INTER_CUBIC) for plane in coarse)
    x, y = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
    return np.asarray(
        cv2.remap(rgb, x + dx, y + dy, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
    )
