"""What distinguishes a cable from its lookalikes, measured along every instance of a scene.

Symbols: I instances, N points along them all, T positions across.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.colors import LAB_OF_A_LEVEL
from models.geometry.sampling import read_nearest
from models.instances.scene import Crossing, Scene

_POINTS = 80
"""Along an instance; more say nothing new."""
_ACROSS = np.linspace(-3.0, 3.0, 25)
"""Positions across an instance, in half widths; beyond its edges half a width is 2 px at least."""
_BODY = np.abs(_ACROSS) <= 0.6
_LEFT, _RIGHT = ((side * _ACROSS >= 1.5) & (side * _ACROSS <= 2.25) for side in (-1, 1))
_NEAR_EDGES = [
    (side * _ACROSS[:-1] + 0.125 > 0.4) & (side * _ACROSS[:-1] + 0.125 < 1.75) for side in (-1, 1)
]
_RING = np.abs(_ACROSS) > 1.3
_LEAST_HALF_PX = 2.0
_LONGEST_PX = 1280
_CERTAIN = 0.99
_LEVELS = 16.0
_NO_OTHER = -2.0
"""Odds of the surest other instance, where there is none."""


class Likeness(NamedTuple):
    """``(I,)`` each, by name: the columns of the rule. Odds are logarithms; lengths, widths, colors
    and crossings are taken as logarithms, too.

    ``certainty`` of the network along it, its ``certainty_low`` and ``certainty_spread``, ``least``
    of it; ``ring``: beside it. ``length`` in widths, ``size`` in diagonals of the picture,
    ``width`` in pixels; ``short`` of the longest instance. ``width_spread``; ``straight``: distance
    of its ends over its length; ``bow`` in pixels. ``crossed``: crossings; ``free`` ends.
    ``shading`` across it; ``contrast`` to the ground; ``edge``, usual and ``edge_low``: steps of
    color a pixel at the weaker of both edges; ``ground``: difference of both sides, and
    ``ground_spread``, ``body_spread`` along it. ``company``: instances; ``surer``: the surest other
    one.
    """

    certainty: FloatArray
    certainty_low: FloatArray
    certainty_spread: FloatArray
    least: FloatArray
    ring: FloatArray
    length: FloatArray
    size: FloatArray
    width: FloatArray
    short: FloatArray
    width_spread: FloatArray
    straight: FloatArray
    bow: FloatArray
    crossed: FloatArray
    free: FloatArray
    shading: FloatArray
    contrast: FloatArray
    edge: FloatArray
    edge_low: FloatArray
    ground: FloatArray
    ground_spread: FloatArray
    body_spread: FloatArray
    company: FloatArray
    surer: FloatArray

    def rows(self) -> FloatArray:
        """``(I, 23)``"""
        return np.stack(self, axis=1)


def likeness(
    scene: Scene, probability: Float32Array, mask: BoolArray, image: ByteArray
) -> Likeness:
    """The evidence on every instance of a scene that has some; ``probability`` and ``mask`` (H, W),
    ``image`` (H, W, 3) RGB."""
    instances = scene.instances
    lines = [_thinned(i.centerline_xy) for i in instances]
    along = _Along([len(line) for line in lines])
    half = np.array([max(i.width_px / 2, 1.0) for i in instances])
    at = _across(lines, half[along.owner])
    lab = cv2.cvtColor(_read(image, at), cv2.COLOR_RGB2Lab) * LAB_OF_A_LEVEL
    seen = _read(probability, at).astype(np.float64)
    length = np.array([max(i.length_px, 1.0) for i in instances])
    surest = seen[:, _BODY].max(axis=1)
    certainty = along.mean(_odds(surest))
    depth = np.maximum(_depths(mask, np.concatenate(lines)), 0.7)
    return Likeness(
        certainty=certainty,
        certainty_low=_odds(along.quantile(surest, 0.15)),
        certainty_spread=along.spread(surest),
        least=along.least(surest),
        ring=along.mean(_odds(seen[:, _RING].max(axis=1))),
        length=np.log(np.clip(length / (2 * half), 1, 60)),
        size=np.log(length / np.hypot(*mask.shape)),
        width=np.log(2 * half),
        short=np.log(length.max() / length),
        width_spread=along.spread(depth) / along.mean(depth),
        straight=np.array([np.hypot(*(line[-1] - line[0])) for line in lines]) / length,
        bow=np.log1p([_bow(line) for line in lines]),
        crossed=np.log1p(_crossings(scene.crossings, len(instances))),
        free=np.array(
            [sum(e.kind == "free" for e in i.endpoints) for i in instances], dtype=np.float64
        ),
        company=np.full(len(instances), np.log1p(len(instances))),
        surer=_surest_other(certainty),
        **_colors(lab, along, half),
    )


class _Along:
    """Statistics along each instance of what is known at its points; ``owner`` (N,)."""

    def __init__(self, counts: Sequence[int]) -> None:
        self.counts = np.array(counts)
        self.owner: IntArray = np.repeat(np.arange(len(counts)), counts)
        self._first = np.cumsum(counts) - self.counts
        self._place = np.arange(len(self.owner)) - self._first[self.owner]

    def mean(self, values: FloatArray) -> FloatArray:
        return np.bincount(self.owner, values) / self.counts

    def spread(self, values: FloatArray) -> FloatArray:
        return np.sqrt(np.maximum(self.mean(values**2) - self.mean(values) ** 2, 0.0))

    def least(self, values: FloatArray) -> FloatArray:
        return np.minimum.reduceat(values, self._first)

    def quantile(self, values: FloatArray, share: float) -> FloatArray:
        """``(I,)`` of ``(N,)`` values, or ``(I, 3)`` of ``(N, 3)``: sorted in one table, a row an
        instance."""
        table = np.full((len(self.counts), self.counts.max(), *values.shape[1:]), np.inf)
        table[self.owner, self._place] = values
        table.sort(axis=1)
        at = share * (self.counts - 1)
        below = at.astype(np.intp)
        rows = np.arange(len(table))
        lower, upper = table[rows, below], table[rows, np.minimum(below + 1, self.counts - 1)]
        part = (at - below).reshape(-1, *[1] * (values.ndim - 1))
        return lower + (upper - lower) * part


def _colors(lab: FloatArray, along: _Along, half: FloatArray) -> dict[str, FloatArray]:
    """What the ``(N, T, 3)`` colors across the instances say, by name."""
    body, left, right = (lab[:, where].mean(axis=1) for where in (_BODY, _LEFT, _RIGHT))
    contrast = np.minimum(*(np.linalg.norm(body - side, axis=1) for side in (left, right)))
    core = len(_ACROSS) // 2
    shading = lab[:, core, 0] - (lab[:, core - 2, 0] + lab[:, core + 2, 0]) / 2
    steps = np.linalg.norm(np.diff(lab, axis=1), axis=2)
    a_step_px = np.maximum(half, 1.0) * (_ACROSS[1] - _ACROSS[0])
    weaker = (
        np.minimum(*(steps[:, where].max(axis=1) for where in _NEAR_EDGES)) / a_step_px[along.owner]
    )
    usual = [along.quantile(values, 0.5) for values in (left, right, body)]
    away = [
        along.mean(np.linalg.norm(values - middle[along.owner], axis=1))
        for values, middle in zip((left, right, body), usual, strict=True)
    ]
    return {
        "shading": along.mean(shading) / _LEVELS,
        "contrast": np.log1p(along.mean(contrast)),
        "edge": np.log1p(along.quantile(weaker, 0.5)),
        "edge_low": np.log1p(along.quantile(weaker, 0.25)),
        "ground": np.log1p(np.linalg.norm(usual[0] - usual[1], axis=1)),
        "ground_spread": np.log1p((away[0] + away[1]) / 2),
        "body_spread": np.log1p(away[2]),
    }


def _thinned(line: FloatArray) -> FloatArray:
    return line[np.linspace(0, len(line) - 1, min(len(line), _POINTS)).astype(np.int64)]


def _across(lines: Sequence[FloatArray], half: FloatArray) -> tuple[Float32Array, Float32Array]:
    """``(N, T)`` x and y of the positions across the lines, ``half`` (N,) their half widths."""
    points = np.concatenate(lines)
    steps = np.concatenate(
        [np.gradient(line, axis=0) if len(line) > 1 else np.ones((1, 2)) for line in lines]
    )
    steps = steps / np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    beyond = np.maximum(np.abs(_ACROSS) - 1, 0.0)
    reach = (
        half[:, None] * np.minimum(np.abs(_ACROSS), 1.0)
        + np.maximum(half, _LEAST_HALF_PX)[:, None] * beyond
    )
    offsets = np.sign(_ACROSS) * reach
    x = points[:, :1] - offsets * steps[:, 1:]
    y = points[:, 1:] + offsets * steps[:, :1]
    return x.astype(np.float32), y.astype(np.float32)


def _read(picture: ByteArray | Float32Array, at: tuple[Float32Array, Float32Array]) -> NDArray[Any]:
    """``(N, T)`` values, or colors, at x and y; beyond the border those of the border."""
    return np.asarray(cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _depths(mask: BoolArray, points: FloatArray) -> FloatArray:
    """``(N,)`` distance of the points to the background; in a large picture of every second, third
    … pixel."""
    step = max(1, round(max(mask.shape) / _LONGEST_PX))
    thin = np.ascontiguousarray(mask[::step, ::step]).view(np.uint8)
    distances = np.asarray(cv2.distanceTransform(thin, cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)
    return step * read_nearest(distances, points / step)


def _odds(chance: FloatArray) -> FloatArray:
    capped = np.clip(chance, 1 - _CERTAIN, _CERTAIN)
    return np.asarray(np.log(capped / (1 - capped)))


def _bow(line: FloatArray) -> float:
    """Largest distance in pixels from the straight line between the ends."""
    chord = line[-1] - line[0]
    normal = np.array([-chord[1], chord[0]]) / max(float(np.hypot(*chord)), 1e-9)
    return float(np.abs((line - line[0]) @ normal).max())


def _surest_other(certainty: FloatArray) -> FloatArray:
    """``(I,)`` the largest of the others' certainties."""
    if len(certainty) < 2:
        return np.full(len(certainty), _NO_OTHER)
    second, first = np.partition(certainty, -2)[-2:]
    return np.where(np.arange(len(certainty)) == certainty.argmax(), second, first)


def _crossings(crossings: Sequence[Crossing], count: int) -> FloatArray:
    """``(I,)`` in how many crossings each instance takes part."""
    of = [{c.over.instance, c.under.instance} for c in crossings]
    return np.bincount([k - 1 for both in of for k in both], minlength=count).astype(np.float64)
