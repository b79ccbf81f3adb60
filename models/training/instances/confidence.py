"""Calibrate the probabilities of every instance method on rendered scenes with worn masks.

    python -m models.training.instances.confidence [--textures PACK] [--scenes 300]

Logistic regressions on the measurements of ``confidence.py``; two thirds of the scenes are fitted,
the calibration error is stated on the others. A few minutes on one core. Writes
``confidence.toml``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tomli_w
import torch

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.polylines import crossing_segments
from models.instances import confidence
from models.instances.methods import METHODS, Extract, method
from models.instances.scene import Scene
from models.synthesis.textures import load_pool
from models.training.instances.logistic import fit_logistic
from models.training.instances.section_matching_scenes import TrainScene, make_scene
from models.weights.inference import Runtime, default_name, load

_SEED = 33
_SHRINKAGE = 1e-3
_NEAR_PX = 15.0


def methods() -> dict[str, Extract]:
    """All four, with their networks."""
    runtime = Runtime(threads=1)
    return {
        name: method(name, lambda task: load(default_name(task), runtime))[0] for name in METHODS
    }


@dataclass
class Samples:
    """Rows of features and whether what they describe was right, one list entry a scene."""

    instance: list[FloatArray] = field(default_factory=list)
    crossing: list[FloatArray] = field(default_factory=list)
    order: list[FloatArray] = field(default_factory=list)
    instance_right: list[BoolArray] = field(default_factory=list)
    crossing_right: list[BoolArray] = field(default_factory=list)
    order_right: list[BoolArray] = field(default_factory=list)


def observe(found: Scene, scene: TrainScene, samples: Samples) -> None:
    """Note what a method measured in a scene, and what of its answer was right."""
    if found.instances:
        samples.instance.append(found.features["instance"])
        samples.instance_right.append(matched(found, scene.ids))
    if found.crossings:
        real, upper = _crossings_right(found, scene)
        samples.crossing.append(found.features["crossing"])
        samples.crossing_right.append(real)
        known = (upper >= 0) & (scene.image is not None)
        samples.order.append(found.features["order"][known])
        samples.order_right.append(upper[known] > 0)


def matched(found: Scene, ids: ByteArray) -> BoolArray:
    """``(I,)`` whether an instance has an IoU above a half with a true cable of ``ids`` (H, W)."""
    count = len(found.instances)
    table = np.zeros((count + 1, int(ids.max()) + 1))
    np.add.at(table, (found.labels.ravel(), ids.ravel()), 1)
    union = table.sum(axis=1, keepdims=True) + table.sum(axis=0, keepdims=True) - table
    iou = (table / np.maximum(union, 1))[1:, 1:]
    return iou.max(axis=1, initial=0.0) > 0.5


def _crossings_right(found: Scene, scene: TrainScene) -> tuple[BoolArray, FloatArray]:
    """``(K,)`` whether a true crossing is near, and 1, 0 or -1: order right, wrong, or not known
    from the ids."""
    thin = [c[::4] for c in scene.curves if len(c) > 8]
    hits = crossing_segments(
        np.concatenate([c[:-1] for c in thin]), np.concatenate([c[1:] for c in thin])
    ).xy
    owner = [_owner(scene.ids[found.labels == k + 1]) for k in range(len(found.instances))]
    real, upper = [], []
    for crossing in found.crossings:
        apart = np.hypot(*(hits - np.array(crossing.xy)).T).min(initial=np.inf)
        real.append(apart <= _NEAR_PX)
        over, under = owner[crossing.over.instance - 1], owner[crossing.under.instance - 1]
        x, y = (round(v) for v in crossing.xy)
        seen = int(
            scene.ids[np.clip(y, 0, scene.ids.shape[0] - 1), np.clip(x, 0, scene.ids.shape[1] - 1)]
        )
        known = real[-1] and over != under and seen in (over, under)
        upper.append(float(seen == over) if known else -1.0)
    return np.array(real, dtype=bool), np.array(upper)


def _owner(ids: ByteArray) -> int:
    """The cable that most of the pixels show, 0 for none."""
    seen = ids[ids > 0]
    return int(np.bincount(seen).argmax()) if len(seen) else 0


def calibration_error(probability: FloatArray, right: BoolArray, bins: int = 10) -> float:
    """Expected calibration error over equally wide bins."""
    index = np.minimum((probability * bins).astype(int), bins - 1)
    error = 0.0
    for k in np.unique(index):
        mine = index == k
        error += mine.mean() * abs(float(probability[mine].mean()) - float(right[mine].mean()))
    return float(error)


def _calibrated(
    features: list[FloatArray], right: list[BoolArray], names: Sequence[str]
) -> dict[str, float]:
    cut = len(features) * 2 // 3
    rows, truth = np.concatenate(features[:cut]), np.concatenate(right[:cut])
    weights = fit_logistic(rows, truth, np.full(rows.shape[1], _SHRINKAGE))
    held, held_truth = np.concatenate(features[cut:]), np.concatenate(right[cut:])
    chance = 1 / (1 + np.exp(-(held @ weights)))
    table = {name: round(float(w), 4) for name, w in zip(names, weights, strict=True)}
    return table | {
        "held_out": len(held_truth),
        "held_out_right": round(float(held_truth.mean()), 4),
        "held_out_error": round(calibration_error(chance, held_truth), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--textures", type=Path, help="a pack of background pictures; without it they are noise"
    )
    parser.add_argument("--scenes", type=int, default=300)
    args = parser.parse_args()
    torch.set_num_threads(1)
    confidence.COEFFICIENTS.write_text(
        ""
    )  # what is measured must not be filtered by an older calibration
    pool = load_pool(args.textures)
    running = methods()
    samples = {name: Samples() for name in running}
    for k in range(args.scenes):
        scene = make_scene(np.random.default_rng([_SEED, k]), pool, wear=0.5)
        for name, extract in running.items() if scene.curves else ():
            observe(extract(scene.mask, scene.image), scene, samples[name])
    table: dict[str, object] = {
        "made_by": {
            "command": "python -m models.training.instances.confidence",
            "scenes": args.scenes,
            "seed": _SEED,
        }
    }
    for name, seen in samples.items():
        table[name] = {
            "instance": _calibrated(
                seen.instance, seen.instance_right, confidence.INSTANCE_FEATURES
            ),
            "crossing": _calibrated(
                seen.crossing, seen.crossing_right, confidence.CROSSING_FEATURES
            ),
            "order": _calibrated(seen.order, seen.order_right, confidence.ORDER_FEATURES),
        }
        print(name, table[name], flush=True)
    confidence.COEFFICIENTS.write_text(tomli_w.dumps(table))


if __name__ == "__main__":
    main()
