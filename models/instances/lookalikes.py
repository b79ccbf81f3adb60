"""Whether what was found is a cable at all: joints, handles, rods and table edges have the shape of
one.

One rule for every method, after it: what is measured along each instance in the picture and in the
network's probability (``likeness.py``) goes into a small network of one hidden layer
(``lookalikes.toml``, written by ``python -m models.training.instances.lookalikes``). What is hardly
a cable beside others is left out of the scene; where this would leave nothing, only what is even
less is, so that no picture of a cable is answered with nothing for a doubt. What may be none is
doubted.

Symbols: I instances, f measurements, h hidden units.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.instances.confidence import SURE
from models.instances.likeness import Likeness, likeness
from models.instances.scene import Instance, Scene

COEFFICIENTS = Path(__file__).with_name("lookalikes.toml")
_EVEN = 0.5
_ALONE = 0.5
"""Share of the probability below which an instance leaves the foreground, where no other is likely
a cable: a straight cable that is alone on a table is much like a joint."""
IN_COMPANY = 0.25
"""Probability at which an instance is left out beside others: a cable left out costs as much as
three lookalikes that are kept."""
_ONE_EDGED = 0.7
"""Share of an instance along which no more than one of its edges is in the picture: a strip of a
frame or of a table's edge is there along most of it, a cable only where it enters."""
_AT_BORDER_PX = 1.5
"""A middle line that is nearer to the border than half a width and this has its outer edge beyond
it."""
FARTHEST = 3.0
"""Standard deviations; what is measured farther off is taken for so far."""


@dataclass(frozen=True)
class Calibration:
    """``mean`` and ``scale`` (f,) of :class:`Likeness`, ``hidden`` (f, h) and ``bias`` (h,),
    ``out`` (h,) and ``offset``; ``least``: the probability below which an instance is hardly a
    cable beside one."""

    mean: FloatArray
    scale: FloatArray
    hidden: FloatArray
    bias: FloatArray
    out: FloatArray
    offset: float
    least: float

    def chance(self, rows: FloatArray) -> FloatArray:
        """``(I,)`` probability of ``(I, f)`` rows of evidence."""
        units = np.tanh(
            np.clip((rows - self.mean) / self.scale, -FARTHEST, FARTHEST) @ self.hidden + self.bias
        )
        out: FloatArray = 1 / (1 + np.exp(-(units @ self.out + self.offset)))
        return out


@cache
def calibration() -> Calibration:
    """The shipped one."""
    table = tomllib.loads(COEFFICIENTS.read_text())
    columns = [table["evidence"][name] for name in Likeness._fields]
    mean, scale, hidden = (
        np.array([column[part] for column in columns]) for part in ("mean", "scale", "hidden")
    )
    bias, out = np.array(table["bias"]), np.array(table["out"])
    return Calibration(mean, scale, hidden, bias, out, table["offset"], table["least"])


def without_lookalikes(
    scene: Scene,
    probability: Float32Array,
    mask: BoolArray,
    image: ByteArray,
    rule: Calibration | None = None,
) -> Scene:
    """The scene of a method, seen in ``image`` (H, W, 3) RGB with ``probability`` (H, W) and
    ``mask`` (H, W)."""
    return rated(scene, chances(scene, probability, mask, image, rule), rule)


def chances(
    scene: Scene,
    probability: Float32Array,
    mask: BoolArray,
    image: ByteArray,
    rule: Calibration | None = None,
) -> FloatArray:
    """``(I,)`` probability that each instance of a scene is a cable; none where it runs along the
    border: a cable has two edges."""
    if not scene.instances:
        return np.zeros(0)
    found = (rule or calibration()).chance(likeness(scene, probability, mask, image).rows())
    return np.where(_one_edged(scene), 0.0, found)


def _one_edged(scene: Scene) -> BoolArray:
    """``(I,)`` which instances run along the picture's border for most of their length."""
    last = np.array(scene.labels.shape[::-1]) - 1
    gaps = [
        np.minimum(i.centerline_xy, last - i.centerline_xy).min(axis=1) for i in scene.instances
    ]
    near = [
        gap <= i.width_px / 2 + _AT_BORDER_PX for i, gap in zip(scene.instances, gaps, strict=True)
    ]
    return np.array([part.mean() >= _ONE_EDGED for part in near])


def hardly(cable: FloatArray, rule: Calibration | None = None) -> BoolArray:
    """``(I,)`` which instances are hardly cables, by the probabilities ``cable`` (I,) of all of a
    scene."""
    limit = (rule or calibration()).least
    return np.asarray(cable < (limit if (cable >= _EVEN).any() else _ALONE * limit))


def rated(scene: Scene, cable: FloatArray, rule: Calibration | None = None) -> Scene:
    """The scene without what is hardly a cable, by the ``(I,)`` probabilities ``cable``."""
    if not scene.instances:
        return scene
    named = tuple(_rated(i, c) for i, c in zip(scene.instances, cable.tolist(), strict=True))
    maybe = ~hardly(cable, rule)
    likely = maybe & (cable >= IN_COMPANY)
    return _only(replace(scene, instances=named), likely if likely.any() else maybe)


def _rated(instance: Instance, cable: float) -> Instance:
    """An instance is no surer to be one whole cable than to be a cable."""
    if cable >= SURE:
        return instance
    return replace(
        instance, score=min(instance.score, cable), reasons=(*instance.reasons, "lookalike")
    )


def _only(scene: Scene, kept: BoolArray) -> Scene:
    """The scene with the instances that are ``kept`` (I,), numbered anew; crossings with others are
    gone."""
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
    return replace(
        scene, instances=instances, crossings=tuple(crossings), labels=number[scene.labels]
    )
