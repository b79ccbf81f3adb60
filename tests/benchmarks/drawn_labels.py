"""Rendered cables whose labels lie beside them as if a hand had drawn them: what the outline's
weights are chosen on.

A hand errs in four ways, and all sizes here are assumptions, not taken from any set: what it draws
in one picture is off alike (how the tool counts pixels, how one sits), it draws a cable wider or
thinner all along, its line wavers, and so does its width. On average it is wider by :data:`RIM_PX`,
because a pixel that is cable in part is labelled as cable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

from models.geometry.arrays import ByteArray, FloatArray
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool

SEED = 2211
SIZE = (360, 640)
WIDTHS_PX = (4, 40)
RIM_PX = 0.35
LEAST_LENGTH_PX = 60
"""What is seen of a cable is at least that long: shorter pieces are labelled with one click."""
MOST_PIECES = 4
"""A cable that is seen in more is wound about another: no outline of one width is its label."""

_WIDTH_SHARE = (WIDTHS_PX[0] / SIZE[1], WIDTHS_PX[1] / SIZE[1])
LOOKS = (
    SceneParams(SIZE, _WIDTH_SHARE, max_cables=4, empty_share=0, clutter=0.4),
    SceneParams(
        SIZE,
        _WIDTH_SHARE,
        max_cables=4,
        empty_share=0,
        style="workshop",
        fan_share=0.2,
        alike_share=0.12,
    ),
    SceneParams(SIZE, _WIDTH_SHARE, max_cables=4, empty_share=0, style="workshop", air_share=1.0),
)
"""In turn: on a plain or painted ground, in a workshop, in the air before it."""


@dataclass(frozen=True)
class Hand:
    """Standard deviations, px: ``shift`` of a picture (along x and y), ``wider`` of a cable's half
    width, ``waver`` of its middle (along x and y) and ``swell`` of its half width, both alike over
    about ``over`` px."""

    shift: float = 0.5
    wider: float = 0.4
    waver: float = 0.4
    swell: float = 0.3
    over: float = 30.0


def pictures(count: int, hand: Hand | None = None) -> Iterator[tuple[str, ByteArray, np.ndarray]]:
    """Name, picture (H, W, 3) and labels (H, W) as of :func:`labelled` of so many renders, the same
    at every call."""
    pool = TexturePool(())
    for k in range(count):
        scene = render_scene(np.random.default_rng([SEED, k]), LOOKS[k % len(LOOKS)], pool)
        labels = labelled(
            scene.ids.cpu().numpy(), np.random.default_rng([SEED, k, 1]), hand or Hand()
        )
        yield f"render{k:03d}", to_uint8(scene.rgb), labels


def labelled(ids: np.ndarray, rng: np.random.Generator, hand: Hand) -> np.ndarray:
    """``ids`` (H, W) as a hand would have drawn them; those of cables that are too short, thin,
    wide or hidden to be measured are negative. Where two would both lie, the one that is more
    certain does."""
    rows, columns = np.mgrid[: ids.shape[0], : ids.shape[1]].astype(np.float64)
    shift = rng.normal(0, hand.shift, 2)
    away = [shift[axis] + _wavering(rng, ids.shape, hand.waver, hand.over) for axis in (0, 1)]
    labels = np.zeros(ids.shape, np.int32)
    best = np.zeros(ids.shape)
    for number in np.unique(ids[ids > 0]):
        mask = ids == number
        wider = rng.normal(RIM_PX, hand.wider) + _wavering(rng, ids.shape, hand.swell, hand.over)
        depth = distance_transform_edt(mask) - distance_transform_edt(~mask)
        thick = 2 * float(np.percentile(depth[mask], 90))
        pieces = cv2.connectedComponents(mask.astype(np.uint8))[0] - 1
        long = mask.sum() >= LEAST_LENGTH_PX * thick
        counts = long and WIDTHS_PX[0] <= thick <= WIDTHS_PX[1] and pieces <= MOST_PIECES
        inside = (
            map_coordinates(depth, [rows + away[1], columns + away[0]], order=1, mode="nearest")
            + wider
        )
        better = inside > best
        labels[better], best[better] = number if counts else -number, inside[better]
    return labels


def _wavering(
    rng: np.random.Generator, shape: tuple[int, ...], sd: float, over: float
) -> FloatArray:
    """Noise of standard deviation ``sd``, smooth over about ``over`` px."""
    noise = gaussian_filter(rng.normal(size=shape), over, mode="wrap")
    return np.asarray(noise * sd / max(float(noise.std()), 1e-12), np.float64)
