"""Whether what was found is a cable at all: joints, handles, rods and table edges have the shape of one.

One rule for every method, after it: measurements along each instance in the picture and in the network's probability go
into a logistic model (``lookalikes.toml``, written by ``python -m models.training.instances.lookalikes``). What is more
likely no cable than one is left out of the scene; where this would leave nothing, only what is hardly one is, so that
no picture of a cable is answered with nothing for a doubt. What may be none is doubted.

Symbols: I instances, N points along them, T positions across.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.sampling import read_nearest
from models.instances.confidence import SURE
from models.instances.scene import Crossing, Instance, Scene

COEFFICIENTS = Path(__file__).with_name("lookalikes.toml")
_POINTS = 80
"""Along an instance; more say nothing new."""
_ACROSS = np.array([-1.9, -0.6, -0.3, 0.0, 0.3, 0.6, 1.9])
"""Positions across an instance in half widths; the first and the last are on the ground beside it."""
_BESIDE_PX = 2.0
_LONGEST_PX = 1280
_CERTAIN = 0.99
EVEN = 0.5
"""Probability at which a cable left out is as likely as a lookalike kept."""
_LEVELS = 16.0


class Likeness(NamedTuple):
    """What tells a cable from its lookalikes, ``(I,)`` each; the columns of the logistic model, by name."""

    one: FloatArray
    certainty: FloatArray
    certainty_low: FloatArray
    certainty_spread: FloatArray
    length: FloatArray
    short: FloatArray
    width_spread: FloatArray
    straight: FloatArray
    crossed: FloatArray
    free: FloatArray
    shading: FloatArray
    contrast: FloatArray
    company: FloatArray

    def rows(self) -> FloatArray:
        """``(I, 13)``"""
        return np.stack(self, axis=1)


@dataclass(frozen=True)
class Calibration:
    """``weights`` of :class:`Likeness`; ``least``: the probability below which an instance is left out even where
    nothing else is found."""

    weights: FloatArray
    least: float


@cache
def calibration() -> Calibration:
    """The shipped one."""
    table = tomllib.loads(COEFFICIENTS.read_text())
    return Calibration(np.array([table["weights"][name] for name in Likeness._fields]), table["least"])


def without_lookalikes(
    scene: Scene, probability: Float32Array, mask: BoolArray, image: ByteArray, rule: Calibration | None = None
) -> Scene:
    """The scene of a method, seen in ``image`` (H, W, 3) RGB with ``probability`` (H, W) and ``mask`` (H, W)."""
    return rated(scene, chances(scene, probability, mask, image, rule), rule)


def chances(
    scene: Scene, probability: Float32Array, mask: BoolArray, image: ByteArray, rule: Calibration | None = None
) -> FloatArray:
    """``(I,)`` probability that each instance of a scene is a cable."""
    if not scene.instances:
        return np.zeros(0)
    return chance(likeness(scene, probability, mask, image).rows(), (rule or calibration()).weights)


def rated(scene: Scene, cable: FloatArray, rule: Calibration | None = None) -> Scene:
    """The scene without what is more likely no cable than one, by the ``(I,)`` probabilities ``cable``."""
    if not scene.instances:
        return scene
    least = (rule or calibration()).least
    named = tuple(_rated(i, c) for i, c in zip(scene.instances, cable.tolist(), strict=True))
    likely = cable >= max(least, EVEN)
    return _only(replace(scene, instances=named), likely if likely.any() else cable >= least)


def chance(rows: FloatArray, weights: FloatArray) -> FloatArray:
    """``(I,)`` probability of ``(I, f)`` rows of evidence."""
    out: FloatArray = 1 / (1 + np.exp(-np.clip(rows @ weights, -30, 30)))
    return out


def likeness(scene: Scene, probability: Float32Array, mask: BoolArray, image: ByteArray) -> Likeness:
    """The evidence on every instance of a scene that has some."""
    instances = scene.instances
    lines = [_thinned(i.centerline_xy) for i in instances]
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    half = np.array([max(i.width_px / 2, 1.0) for i in instances])
    at = _across(lines, half[owner])
    lab = cv2.cvtColor(_read(image, at), cv2.COLOR_RGB2Lab).astype(np.float64)
    along = _read(probability, at)[:, 1:-1].max(axis=1).astype(np.float64)
    depth = np.maximum(_depths(mask, np.concatenate(lines)), 0.7)
    body = lab[:, 1:-1].mean(axis=1)
    contrast = np.minimum(*(np.linalg.norm(body - lab[:, side], axis=1) for side in (0, -1)))
    width, length = 2 * half, np.array([max(i.length_px, 1.0) for i in instances])
    reach = np.array([np.hypot(*(line[-1] - line[0])) for line in lines])
    return Likeness(
        one=np.ones(len(instances)),
        certainty=_mean(_odds(along), owner),
        certainty_low=_odds(np.array([np.quantile(along[owner == k], 0.15) for k in range(len(lines))])),
        certainty_spread=_spread(along, owner),
        length=np.log(np.clip(length / width, 1, 60)),
        short=np.log(length.max() / length),
        width_spread=_spread(depth, owner) / _mean(depth, owner),
        straight=reach / length,
        crossed=np.log1p(_crossings(scene.crossings, len(instances))),
        free=np.array([sum(e.kind == "free" for e in i.endpoints) for i in instances], dtype=np.float64),
        shading=_mean(lab[:, 3, 0] - (lab[:, 1, 0] + lab[:, 5, 0]) / 2, owner) / _LEVELS,
        contrast=np.log1p(_mean(contrast, owner)),
        company=np.full(len(instances), np.log1p(len(instances))),
    )


def _thinned(line: FloatArray) -> FloatArray:
    return line[np.linspace(0, len(line) - 1, min(len(line), _POINTS)).astype(np.int64)]


def _across(lines: Sequence[FloatArray], half: FloatArray) -> tuple[Float32Array, Float32Array]:
    """``(N, T)`` x and y of the positions across the lines, ``half`` (N,) their half widths."""
    points = np.concatenate(lines)
    steps = np.concatenate([np.gradient(line, axis=0) if len(line) > 1 else np.ones((1, 2)) for line in lines])
    steps = steps / np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    offsets = _ACROSS * half[:, None]
    offsets[:, 0] = np.minimum(offsets[:, 0], -half - _BESIDE_PX)
    offsets[:, -1] = np.maximum(offsets[:, -1], half + _BESIDE_PX)
    x = points[:, :1] - offsets * steps[:, 1:]
    y = points[:, 1:] + offsets * steps[:, :1]
    return x.astype(np.float32), y.astype(np.float32)


def _read(picture: ByteArray | Float32Array, at: tuple[Float32Array, Float32Array]) -> NDArray[Any]:
    """``(N, T)`` values, or colors, at x and y; beyond the border those of the border."""
    return np.asarray(cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _depths(mask: BoolArray, points: FloatArray) -> FloatArray:
    """``(N,)`` distance of the points to the background; in a large picture of every second, third … pixel."""
    step = max(1, round(max(mask.shape) / _LONGEST_PX))
    thin = np.ascontiguousarray(mask[::step, ::step]).view(np.uint8)
    distances = np.asarray(cv2.distanceTransform(thin, cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)
    return step * read_nearest(distances, points / step)


def _mean(values: FloatArray, owner: IntArray) -> FloatArray:
    return np.bincount(owner, values) / np.bincount(owner)


def _spread(values: FloatArray, owner: IntArray) -> FloatArray:
    return np.sqrt(np.maximum(_mean(values**2, owner) - _mean(values, owner) ** 2, 0.0))


def _odds(chance: FloatArray) -> FloatArray:
    capped = np.clip(chance, 1 - _CERTAIN, _CERTAIN)
    return np.asarray(np.log(capped / (1 - capped)))


def _crossings(crossings: Sequence[Crossing], count: int) -> FloatArray:
    """``(I,)`` in how many crossings each instance takes part."""
    of = [{c.over.instance, c.under.instance} for c in crossings]
    return np.bincount([k - 1 for both in of for k in both], minlength=count).astype(np.float64)


def _rated(instance: Instance, cable: float) -> Instance:
    """An instance is no surer to be one whole cable than to be a cable."""
    if cable >= SURE:
        return instance
    return replace(instance, score=min(instance.score, cable), reasons=(*instance.reasons, "lookalike"))


def _only(scene: Scene, kept: BoolArray) -> Scene:
    """The scene with the instances that are ``kept`` (I,), numbered anew; crossings with others are gone."""
    if kept.all():
        return scene
    number = np.concatenate(([0], np.where(kept, np.cumsum(kept), 0))).astype(np.uint8)
    crossings = [
        replace(
            c,
            over=replace(c.over, instance=int(number[c.over.instance])),
            under=replace(c.under, instance=int(number[c.under.instance])),
        )
        for c in scene.crossings
        if number[c.over.instance] and number[c.under.instance]
    ]
    instances = tuple(i for i, keep in zip(scene.instances, kept, strict=True) if keep)
    return replace(scene, instances=instances, crossings=tuple(crossings), labels=number[scene.labels])
