"""Rendered scenes with worn masks, to fit link weights and confidences on."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.geometry.polylines import arc_lengths
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool

_SIZES = ((360, 640), (480, 640), (400, 560))


@dataclass(frozen=True, eq=False)
class TrainScene:
    """``image``: ``(H, W, 3)`` or None; ``mask``: worn foreground; ``ids``: ``(H, W)`` who is seen;
    ``curves``: true centerlines ``(n, 2)``."""

    image: ByteArray | None
    mask: BoolArray
    ids: ByteArray
    curves: tuple[FloatArray, ...]
    widths_px: tuple[float, ...]


def make_scene(
    rng: np.random.Generator, pool: TexturePool, wear: float = 1.0, cut_share: float = 0.0
) -> TrainScene:
    """One scene; every sixth is without its picture. ``wear``: at most how worn its mask is, 0 to
    1; ``cut_share``: of its cables are two whose ends face each other."""
    params = SceneParams(
        size=_SIZES[rng.integers(len(_SIZES))],
        width_share=(0.008, 0.04),
        empty_share=0.0,
        clutter=0.5,
        max_cables=int(rng.integers(2, 8)),
        cut_share=cut_share,
    )
    scene = render_scene(rng, params, pool)
    ids = scene.ids.numpy().astype(np.uint8)
    image = None if rng.random() < 1 / 6 else np.ascontiguousarray(to_uint8(scene.rgb))
    curves = tuple(c[:, :2].astype(np.float64) for c in scene.centerlines)
    severity = wear * rng.random() ** 0.5
    seen = (ids > 0) & ~_lost_at_crossings(scene, ids, rng, 0.5 * severity**2)
    return TrainScene(image, worn(seen, rng, severity), ids, curves, scene.widths_px)


def _lost_at_crossings(
    scene: Labelled, ids: ByteArray, rng: np.random.Generator, share: float
) -> BoolArray:
    """Lower strands near this ``share`` of the crossings, on one side or both: networks often see
    them end there."""
    lost = np.zeros(ids.shape, bool)
    rows, columns = np.indices(ids.shape)
    for crossing in scene.crossings:
        if crossing.over == crossing.under or rng.random() >= share:
            continue
        x, y = columns - crossing.xy[0], rows - crossing.xy[1]
        reach = rng.uniform(0.6, 3.0) * scene.widths_px[crossing.over - 1]
        angle = rng.uniform(-np.pi, np.pi)
        side = (x * np.cos(angle) + y * np.sin(angle) > 0) | (rng.random() < 0.3)
        lost |= (ids == crossing.under) & (x**2 + y**2 < reach**2) & side
    return lost


def worn(mask: BoolArray, rng: np.random.Generator, wear: float = 1.0) -> BoolArray:
    """The mask as a segmentation network might give it: uneven outline, holes, gaps, thinner, with
    false patches.

    ``wear``: how much of that, 0 to 1.
    """
    shape = mask.shape
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), rng.uniform(0.6, 1.5))
    noise = cv2.GaussianBlur(
        rng.normal(size=shape).astype(np.float32), (0, 0), rng.uniform(0.8, 4.0)
    )
    threshold = 0.5 + wear * rng.uniform(-0.15, 0.15)
    out: BoolArray = (
        soft + noise * (wear * rng.uniform(0, 0.25) / max(float(noise.std()), 1e-6)) > threshold
    )
    rows, columns = np.nonzero(out)
    if not len(rows):
        return out
    for k in rng.integers(0, len(rows), round(wear * rng.integers(0, 10))):
        half = rng.integers(1, 5)
        out[
            max(rows[k] - half, 0) : rows[k] + half + 1,
            max(columns[k] - half, 0) : columns[k] + half + 1,
        ] = False
    for k in rng.integers(0, len(rows), round(wear * rng.integers(0, 4))):
        gone = np.zeros(shape, np.uint8)
        cv2.circle(
            gone,
            (int(columns[k]), int(rows[k])),
            int(rng.integers(6, 30) * (3 if rng.random() < 0.2 else 1)),
            1,
            -1,
        )
        out &= gone == 0
    for _ in range(rng.integers(0, 1 + round(4 * wear))):
        out |= _false_patch(shape, rng)
    thinner = round(wear * rng.choice([0, 0, 0, 1, 2]))
    return (
        cv2.erode(out.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=thinner) > 0
        if thinner
        else out
    )


def _false_patch(shape: tuple[int, ...], rng: np.random.Generator) -> BoolArray:
    """Something that is no cable: a blob, or a straight piece as of a tool or a joint between
    tiles."""
    x, y = int(rng.integers(shape[1])), int(rng.integers(shape[0]))
    angle = float(rng.uniform(0, 180))
    patch = np.zeros(shape, np.uint8)
    if rng.random() < 0.5:
        cv2.ellipse(
            patch, (x, y), (int(rng.integers(5, 40)), int(rng.integers(2, 9))), angle, 0, 360, 1, -1
        )
    else:
        reach = rng.integers(15, 120) * np.array(
            [np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))]
        )
        cv2.line(
            patch, (x, y), (round(x + reach[0]), round(y + reach[1])), 1, int(rng.integers(3, 11))
        )
    return patch > 0


@dataclass(frozen=True, eq=False)
class CurveIndex:
    """All true curves as one cloud of points: cable, arc length and unit tangent of each."""

    tree: cKDTree
    cable: IntArray
    at: FloatArray
    tangent: FloatArray

    @staticmethod
    def of(curves: tuple[FloatArray, ...]) -> CurveIndex:
        thin = [curve[::2] for curve in curves]
        tangents = [np.gradient(curve, axis=0) for curve in thin]
        tangents = [t / np.maximum(np.hypot(*t.T), 1e-9)[:, None] for t in tangents]
        cable = np.repeat(np.arange(len(thin)), [len(c) for c in thin])
        at = np.concatenate([arc_lengths(c) for c in thin])
        return CurveIndex(cKDTree(np.concatenate(thin)), cable, at, np.concatenate(tangents))

    def strand_at(
        self, xy: FloatArray, along: FloatArray, reach: float
    ) -> tuple[int, float, float] | None:
        """(cable, arc length, +1 or -1 as ``along`` follows the curve) of the nearest strand in
        that direction."""
        near = np.array(self.tree.query_ball_point(xy, reach), dtype=np.int64)
        cosine = self.tangent[near] @ along
        near, cosine = near[np.abs(cosine) > 0.8], cosine[np.abs(cosine) > 0.8]
        if not len(near):
            return None
        k = int(np.argmin(np.hypot(*(self.tree.data[near] - xy).T)))
        return int(self.cable[near[k]]), float(self.at[near[k]]), float(np.sign(cosine[k]))

    def strands_through(self, xy: FloatArray, along: FloatArray, reach: float) -> int:
        """How many strands run through a place in that direction; two parts of one cable are
        two."""
        near = np.array(self.tree.query_ball_point(xy, reach), dtype=np.int64)
        near = near[np.abs(self.tangent[near] @ along) > 0.8]
        order = np.lexsort((self.at[near], self.cable[near]))
        cable, at = self.cable[near][order], self.at[near][order]
        apart = (np.diff(cable, prepend=-1) != 0) | (np.diff(at, prepend=0.0) > 4 * reach + 4)
        return int(apart.sum())
