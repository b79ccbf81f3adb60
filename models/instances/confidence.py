"""How sure an answer is: probabilities from a few measurements, calibrated on rendered scenes.

Symbols: I instances, K crossings. Coefficients are those of logistic models, one set a method, in
``confidence.toml``, which ``train_confidence.py`` writes.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import expit, logit

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.geometry.directions import quarter_turned, tangents_of_each
from models.geometry.sampling import read_nearest
from models.instances.crossings import Meeting
from models.instances.scene import Crossing, Endpoint, Instance, Reason

COEFFICIENTS = Path(__file__).with_name("confidence.toml")
INSTANCE_FEATURES = (
    "one",
    "length",
    "gap",
    "doubt",
    "free",
    "odd_width",
    "beside",
    "low_contrast",
    "no_image",
    "short",
)
CROSSING_FEATURES = ("one", "slant", "strands")
ORDER_FEATURES = ("contrast", "weak_contrast")
SURE = 0.8
"""Instances below this probability get the reasons for it."""
_SAMPLED = 40
"""Places along an instance, about, at which its edges are looked at."""
_FROM_EDGE = np.array([-4.0, -1.5, 1.5, 4.0])
"""Pixels from an edge, outward, at which colors are read; inside at most to the middle."""
_FADING_LEVELS = 20.0
_LONGEST, _MOST_DOUBT, _ODDEST = 60, 4.0, 1.5
"""Length in widths, doubt, and logarithm of an odd width: more counts no more."""
_DOUBTFUL, _ALONGSIDE = 0.7, 0.15
"""Doubt, and share beside another, that are reasons to be unsure."""
_FAINT_LEVELS = 12.0
_SHARP = 0.4
"""Contrast at which its lack counts 1/e, below which it is a reason; sharpness below which blur is
one."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Per instance ``(I,)``: ``gap`` share of the centerline off the foreground; ``doubt`` minus
    the log probability of its joints; ``beside`` share that runs along another instance;
    ``contrast`` mean difference in gray levels to what is next to it and ``sharpness`` of its
    edges, 0 to 1 (both nan without a picture)."""

    gap: FloatArray
    doubt: FloatArray
    beside: FloatArray
    contrast: FloatArray
    sharpness: FloatArray


@cache
def coefficients() -> dict[str, Any]:
    """The calibration of every method; a method that is not in it has none."""
    return tomllib.loads(COEFFICIENTS.read_text()) if COEFFICIENTS.exists() else {}


def probability(
    features: FloatArray, method: str, part: str, names: Sequence[str]
) -> FloatArray | None:
    """``(n,)`` of ``(n, f)`` features; None without a calibration."""
    table = coefficients().get(method, {}).get(part)
    if table is None:
        return None
    out: FloatArray = expit(features @ np.array([table[n] for n in names]))
    return out


def evidence_of(
    instances: Sequence[Instance], doubts: Sequence[float], mask: BoolArray, image: ByteArray | None
) -> Evidence:
    """What speaks for and against each instance."""
    if not instances:
        nothing = np.zeros(0)
        return Evidence(nothing, nothing, nothing, nothing, nothing)
    points = np.concatenate([i.centerline_xy for i in instances])
    owner = np.repeat(np.arange(len(instances)), [len(i.centerline_xy) for i in instances])
    gap = 1 - np.bincount(owner, read_nearest(mask, points)) / np.bincount(owner)
    unseen = np.full(len(instances), np.nan)
    contrast, sharpness = (unseen, unseen) if image is None else _edges(instances, image)
    return Evidence(
        gap,
        np.array(doubts, dtype=np.float64),
        _beside(instances, points, owner),
        contrast,
        sharpness,
    )


def _beside(instances: Sequence[Instance], points: FloatArray, owner: IntArray) -> FloatArray:
    """Share of each centerline along which another instance's is within both widths, in about its
    direction; all centerlines' ``points`` (N, 2) and whose they are (N,)."""
    if len(instances) < 2:
        return np.zeros(len(instances))
    steps = tangents_of_each(points, owner)
    width = np.array([i.width_px for i in instances])
    pairs = cKDTree(points).query_pairs(1.2 * float(np.median(width)) + 2, output_type="ndarray")
    of = owner[pairs]
    a, b = pairs[of[:, 0] != of[:, 1]].T
    along = np.abs(np.einsum("ij,ij->i", steps[a], steps[b])) > 0.9
    near = np.zeros(len(points), dtype=bool)
    near[a[along]] = near[b[along]] = True
    return np.bincount(owner, near, len(instances)) / np.bincount(owner, minlength=len(instances))


def _edges(instances: Sequence[Instance], image: ByteArray) -> tuple[FloatArray, FloatArray]:
    """``(I,)`` contrast in gray levels over both edges, and the share of it that is within three
    pixels."""
    lines = [i.centerline_xy[:: max(1, len(i.centerline_xy) // _SAMPLED)] for i in instances]
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    points = np.concatenate(lines)
    normals = quarter_turned(tangents_of_each(points, owner))
    half = np.array([i.width_px / 2 for i in instances])[owner, None]
    offsets = np.maximum(half + _FROM_EDGE, [0.0, 0.0, -np.inf, -np.inf])
    signed = np.concatenate((offsets, -offsets), axis=1)
    places = points[:, None] + signed[..., None] * normals[:, None]
    colors = read_nearest(image, places).reshape(len(owner), 2, -1, 3)
    steps = (
        np.abs(colors[:, :, a] - colors[:, :, b]).mean(axis=(1, 2)) for a, b in ((3, 0), (2, 1))
    )
    whole, inner = (np.bincount(owner, step) / np.bincount(owner) for step in steps)
    return whole, np.minimum(1.0, inner / np.maximum(whole, 1.0))


_REASON_OF: dict[str, Reason] = {
    "gap": "gap",
    "doubt": "gap",
    "free": "free_ends",
    "odd_width": "odd_width",
    "beside": "parallel",
    "low_contrast": "low_contrast",
    "no_image": "no_picture",
    "short": "short",
}
"""What a measurement that lowers the probability stands for."""


def instance_features(
    instances: Sequence[Instance], ends: Sequence[Sequence[Endpoint]], evidence: Evidence
) -> FloatArray:
    """``(I, 10)`` the measurements of :data:`INSTANCE_FEATURES`."""
    width = np.array([i.width_px for i in instances])
    length = np.array([i.length_px for i in instances])
    free = np.array(
        [all(e.kind == "free" for e in these) and len(these) > 0 for these in ends],
        dtype=np.float64,
    )
    unseen = np.isnan(evidence.contrast)
    faint = np.where(unseen, 0.0, np.exp(-np.nan_to_num(evidence.contrast) / _FADING_LEVELS))
    columns = (
        np.ones(len(width)),
        np.log(np.clip(length / width, 1, _LONGEST)),
        np.minimum(evidence.gap, 0.5),
        np.minimum(evidence.doubt, _MOST_DOUBT),
        free,
        np.minimum(np.abs(np.log(width / typical_width(instances))), _ODDEST),
        evidence.beside,
        faint,
        unseen.astype(np.float64),
        np.minimum(np.log(length.max(initial=1.0) / length), 3.0),
    )
    return np.stack(columns, axis=1)


def typical_width(instances: Sequence[Instance]) -> float:
    """Median width, each instance counted by its length."""
    if not instances:
        return 1.0
    widths = np.array([i.width_px for i in instances])
    order = np.argsort(widths, kind="stable")
    reached = np.cumsum([instances[k].length_px for k in order])
    return float(widths[order[np.searchsorted(reached, reached[-1] / 2)]])


def reasons_of(
    instance: Instance, ends: Sequence[Endpoint], evidence: Evidence, k: int
) -> tuple[Reason, ...]:
    """Why instance ``k`` is unsure, most serious first."""
    at_border = any(e.kind == "border" for e in ends)
    found: list[tuple[bool, Reason]] = [
        (
            evidence.gap[k] * instance.length_px > instance.width_px
            or evidence.doubt[k] > _DOUBTFUL,
            "gap",
        ),
        (bool(evidence.beside[k] > _ALONGSIDE), "parallel"),
        (bool(evidence.contrast[k] < _FAINT_LEVELS), "low_contrast"),
        (bool(evidence.sharpness[k] < _SHARP), "blur"),
        (at_border and instance.length_px < 12 * instance.width_px, "border"),
    ]
    return tuple(reason for true, reason in found if true)


def heaviest_reason(features: FloatArray, weights: dict[str, float]) -> tuple[Reason, ...]:
    """That of the measurement, of one row of :func:`instance_features`, which lowers the
    probability most; none when none does."""
    losses = {name: features[INSTANCE_FEATURES.index(name)] * weights[name] for name in _REASON_OF}
    worst = min(losses, key=lambda name: losses[name])
    return (_REASON_OF[worst],) if losses[worst] < 0 else ()


def rated(
    instances: Sequence[Instance],
    ends: Sequence[Sequence[Endpoint]],
    evidence: Evidence,
    features: FloatArray,
    method: str,
) -> list[Instance]:
    """The instances with their probabilities and, where those are low, the reasons."""
    scores = probability(features, method, "instance", INSTANCE_FEATURES)
    if scores is None or not instances:
        return list(instances)
    out = []
    for k, (instance, score) in enumerate(zip(instances, scores.tolist(), strict=True)):
        reasons: tuple[Reason, ...] = ()
        if score < SURE:
            weights = coefficients()[method]["instance"]
            reasons = reasons_of(instance, ends[k], evidence, k) or heaviest_reason(
                features[k], weights
            )
        out.append(replace(instance, score=score, reasons=reasons))
    return out


def crossing_features(meetings: Sequence[Meeting], instances: Sequence[Instance]) -> FloatArray:
    """``(K, 3)`` of :data:`CROSSING_FEATURES`: how shallow the angle is, and how sure both strands
    are."""
    strands = [min(instances[m.a].score, instances[m.b].score) for m in meetings]
    slant = [-np.log(max(m.sine, 0.05)) for m in meetings]
    return np.stack((np.ones(len(meetings)), np.array(slant), np.array(strands)), axis=1)


def order_features(crossings: Sequence[Crossing]) -> FloatArray:
    """``(K, 2)`` of :data:`ORDER_FEATURES`: log odds of the order's raw scores, as they are and
    capped."""
    odds = logit(np.array([c.score for c in crossings], dtype=np.float64))
    return np.stack((np.minimum(odds, 6.0), np.minimum(odds, 1.0)), axis=1)


def rated_crossings(
    crossings: Sequence[Crossing], existence: FloatArray, order_seen: FloatArray, method: str
) -> tuple[Crossing, ...]:
    """The crossings with the probabilities that they are some, and that their order is right.

    ``existence``, ``order_seen``: the features of both.
    """
    real = probability(existence, method, "crossing", CROSSING_FEATURES)
    order = probability(order_seen, method, "order", ORDER_FEATURES)
    if real is None or order is None:
        return tuple(crossings)
    pairs = zip(crossings, order.tolist(), real.tolist(), strict=True)
    return tuple(replace(c, score=max(0.5, o), existence=r) for c, o, r in pairs)
