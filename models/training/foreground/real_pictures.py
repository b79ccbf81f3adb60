"""Hand-marked photographs and photographs without cables, as a source of training cuts.

A folder of labelled pictures holds ``imgs/ID.jpg`` and ``masks/ID.png`` (255 cable, 0 not, 128
cannot tell); a folder of pictures without cables holds the pictures alone. The part of a name
before its first ``_`` names the place it comes from: places are drawn with equal chance up to a
limit, so that a hundred pictures of one table do not drown nine of another.
"""

from __future__ import annotations

import zlib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.training.foreground.augmentation import Cut, Rng, cut_out

_KEPT_ASIDE = 8
_MOST_OF_A_PLACE = 2.5
"""A place with many pictures is drawn at most this many times as often as one with few."""
_MARKED_POINTS = 400


@dataclass(frozen=True)
class Photograph:
    """``rgb`` (h, w, 3), ``labels`` (h, w) 255, 128 or 0; ``marked`` (n, 2) some pixels x, y of
    cables."""

    name: str
    rgb: ByteArray
    labels: ByteArray
    marked: FloatArray

    def sample(self, rng: Rng, cut: Cut) -> tuple[ByteArray, ByteArray]:
        """A cut (h, w, 3) and its labels (h, w); three times in four it is around a marked pixel,
        if there is one."""
        at = None
        if len(self.marked) and rng.random() < 0.75:
            at = self.marked[rng.integers(len(self.marked))]
        return cut_out(self.rgb, self.labels, cut, rng, at)


@dataclass(frozen=True)
class RealPictures:
    """Photographs with the chance of each to be drawn."""

    photographs: tuple[Photograph, ...]
    chances: FloatArray

    def sample(self, rng: Rng, cut: Cut) -> tuple[ByteArray, ByteArray]:
        """A cut (h, w, 3) and its labels (h, w); three times in four it is around a marked pixel,
        if there is one."""
        drawn = self.photographs[rng.choice(len(self.photographs), p=self.chances)]
        # Photographs are at most 1280 px long; of smaller ones a smaller part is shrunk away.
        return drawn.sample(rng, cut)


def kept_aside(name: str) -> bool:
    """Whether a picture measures and never trains: one in eight, by its name."""
    return zlib.crc32(name.encode()) % _KEPT_ASIDE == 0


def load_labelled(folder: Path, aside: bool = False) -> RealPictures:
    """The labelled pictures of ``folder`` that train, or those kept aside. Raises ValueError when
    there is none."""
    return _weighted(
        [
            photograph(file, folder / "masks" / f"{file.stem}.png")
            for file in sorted((folder / "imgs").iterdir())
            if kept_aside(file.stem) == aside
        ]
    )


def load_empty(folder: Path, aside: bool = False) -> RealPictures:
    """The pictures without cables of ``folder`` that train, or those kept aside. Raises ValueError
    when none."""
    return _weighted(
        [photograph(f, None) for f in sorted(folder.glob("*.jpg")) if kept_aside(f.stem) == aside]
    )


def photograph(file: Path, mask: Path | None) -> Photograph:
    """A picture with its mask, or without a cable. Raises ValueError when they do not fit or are
    none."""
    bgr = cv2.imread(str(file), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError(f"{file} is not a picture")
    labels = np.zeros(bgr.shape[:2], np.uint8)
    if mask is not None:
        labels = np.asarray(cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE), np.uint8)
    if labels.shape != bgr.shape[:2]:
        raise ValueError(f"the mask of {file} has another size than the picture")
    y, x = np.nonzero(labels == 255)
    some = np.linspace(0, len(x) - 1, min(_MARKED_POINTS, len(x))).astype(int)
    return Photograph(
        file.stem,
        np.ascontiguousarray(bgr[:, :, ::-1]),
        labels,
        np.column_stack([x, y])[some].astype(float),
    )


def _weighted(photographs: list[Photograph]) -> RealPictures:
    if not photographs:
        raise ValueError("there is no picture to train from")
    places: dict[str, int] = defaultdict(int)
    for one in photographs:
        places[one.name.split("_")[0]] += 1
    least = min(places.values())
    share = {place: min(count, _MOST_OF_A_PLACE * least) / count for place, count in places.items()}
    chances = np.array([share[p.name.split("_")[0]] for p in photographs])
    return RealPictures(tuple(photographs), chances / chances.sum())
