"""Labels to test with: two cables that cross, one with a gap where it is hidden, one a ring with a
hole."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from dlo_client.contracts import Crossing, MaskRLE, StrandPosition
from dlo_client.labelling import LabelledInstance, PictureLabel

from models.geometry.rle import decode, encode

WIDTH, HEIGHT = 90, 70
NAME = "shelf 2/näh bild.png"


def disk_line(points: np.ndarray, radius: float) -> np.ndarray:
    """(H, W) pixels within ``radius`` of dense points."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (np.hypot(x[..., None] - points[:, 0], y[..., None] - points[:, 1]) <= radius).any(-1)


def label(name: str = NAME) -> PictureLabel:
    """One that nothing else holds: a test may change it."""
    return _drawn().model_copy(update={"name": name}, deep=True)


@lru_cache(maxsize=1)
def _drawn() -> PictureLabel:
    t = np.linspace(0, 1, 200)
    upper = np.stack([4 + 80 * t, 20 + 10 * np.sin(5 * t)], 1)
    lower = np.stack([30 + 6 * np.sin(4 * t), 2 + 64 * t], 1)
    ring = np.stack([65 + 14 * np.cos(2 * np.pi * t), 50 + 13 * np.sin(2 * np.pi * t)], 1)
    top = disk_line(upper, 3.2)
    masks = [top, disk_line(lower, 2.4) & ~top, disk_line(ring, 2.0) & ~top]
    lines = [upper[::10], lower[::10], ring[::10]]
    return PictureLabel(
        name=NAME,
        width=WIDTH,
        height=HEIGHT,
        instances=[
            LabelledInstance(
                id=k,
                score=0.5 + 0.1 * k,
                centerline_xy=[(round(x, 2), round(y, 2)) for x, y in line.tolist()],
                width_px=5.0 + k,
                closed=k == 3,
                mask_rle=rle(mask),
            )
            for k, (mask, line) in enumerate(zip(masks, lines, strict=True), start=1)
        ],
        crossings=[
            Crossing(
                id=1,
                xy=(33.0, 29.0),
                over=StrandPosition(instance=1, u=0.36),
                under=StrandPosition(instance=2, u=0.42),
                score=0.8,
            )
        ],
    )


def rle(mask: np.ndarray) -> MaskRLE:
    return MaskRLE(size=mask.shape, counts=encode(mask))


def mask(item: LabelledInstance) -> np.ndarray:
    return decode(item.mask_rle.counts, item.mask_rle.size)
