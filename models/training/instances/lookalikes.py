"""Fit what tells cables from their lookalikes: ``python -m models.training.instances.lookalikes --textures PACK``.

Rendered scenes of tables and of workshops, photographs with marked cables and photographs without any go through the
foreground network and the default method; an instance is a cable when most of its centerline lies on one. Two thirds
are fitted; the figures are of the others. Writes ``lookalikes.toml``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import tomli_w
import torch

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.sampling import read_nearest
from models.instances import lookalikes
from models.instances.lookalikes import Likeness, chance, likeness
from models.instances.section_matching import extract
from models.segmentation.effort import look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.synthesis.scenes import WORKSHOP, SceneParams, render_scene, to_uint8
from models.synthesis.textures import load_pool
from models.training.foreground.augmentation import UNKNOWN
from models.training.foreground.real_pictures import load_empty, load_labelled
from models.training.instances.confidence import calibration_error
from models.training.instances.logistic import fit_logistic
from models.weights.inference import Network, Runtime, default_name, load

_SEED = 771
_SHRINKAGE = 3e-3
_LOST = 0.02
"""Share of the true cables that may be left out even where nothing else is found."""
_TABLE = SceneParams((360, 640))
_WORKSHOP = replace(WORKSHOP, size=(360, 640), empty_share=0.25)


class Labelled(NamedTuple):
    """``image`` (H, W, 3); ``labels`` (H, W): 255 cable, 0 none, 128 cannot tell."""

    image: ByteArray
    labels: ByteArray


class Seen(NamedTuple):
    """Of the instances of one picture of which one can tell: ``rows`` (I, features), ``cable`` (I,) whether each is
    one."""

    rows: FloatArray
    cable: BoolArray


def rendered(count: int, textures: Path | None) -> Iterator[Labelled]:
    pool = load_pool(textures)
    for k in range(count):
        scene = render_scene(np.random.default_rng([_SEED, k]), _WORKSHOP if k % 2 else _TABLE, pool)
        yield Labelled(to_uint8(scene.rgb), np.where(scene.ids.numpy() > 0, 255, 0).astype(np.uint8))


def photographed(labelled: Path | None, empty: Path | None) -> Iterator[Labelled]:
    for folder, read in ((labelled, load_labelled), (empty, load_empty)):
        if folder is not None:
            yield from (Labelled(p.rgb, p.labels) for p in read(folder).photographs)


def observe(picture: Labelled, network: Network, settings: ForegroundInput) -> Seen:
    """What is found in a picture, and what of it is true."""
    probability = look(picture.image, network, settings)
    mask = foreground_mask(probability, settings)
    scene = extract(mask, picture.image)
    if not scene.instances:
        return Seen(np.zeros((0, len(Likeness._fields))), np.zeros(0, bool))
    marked = cv2.dilate((picture.labels == 255).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    known = [read_nearest(picture.labels != UNKNOWN, i.centerline_xy) > 0 for i in scene.instances]
    on = [read_nearest(marked, i.centerline_xy)[k] for i, k in zip(scene.instances, known, strict=True)]
    told = np.array([k.mean() > 0.5 for k in known])
    cable = np.array([len(values) > 0 and values.mean() > 0.5 for values in on])
    rows = likeness(scene, probability, mask, picture.image).rows()
    return Seen(rows[told], cable[told])


def fit(seen: list[Seen]) -> dict[str, object]:
    """Weights, threshold and figures, as ``lookalikes.toml`` has them; the order of the pictures does not matter."""
    order = np.random.default_rng(_SEED).permutation(len(seen))
    cut = len(order) * 2 // 3
    fitted, held = (_joined([seen[k] for k in part]) for part in (order[:cut], order[cut:]))
    scale = fitted.rows.std(axis=0)
    scale[0] = 1.0  # the column of ones
    weights = fit_logistic(fitted.rows / scale, fitted.cable, np.full(len(scale), _SHRINKAGE)) / scale
    least = float(np.quantile(chance(fitted.rows, weights)[fitted.cable], _LOST))
    real = chance(held.rows, weights)
    even = max(least, lookalikes.EVEN)
    return {
        "least": round(least, 4),
        "weights": {name: round(float(w), 4) for name, w in zip(Likeness._fields, weights, strict=True)},
        "held_out": {
            "instances": len(held.cable),
            "cables": int(held.cable.sum()),
            "cables_left_out": round(float((real[held.cable] < least).mean()), 4),
            "others_left_out": round(float((real[~held.cable] < least).mean()), 4),
            "cables_left_out_in_company": round(float((real[held.cable] < even).mean()), 4),
            "others_left_out_in_company": round(float((real[~held.cable] < even).mean()), 4),
            "calibration_error": round(calibration_error(real, held.cable), 4),
        },
    }


def _joined(parts: list[Seen]) -> Seen:
    return Seen(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--textures", type=Path, help="a pack of background pictures; without it they are noise")
    parser.add_argument("--labelled", type=Path, help="folder with imgs/ and masks/ of marked photographs")
    parser.add_argument("--empty-pictures", type=Path, help="folder of photographs without cables")
    parser.add_argument("--scenes", type=int, default=400)
    args = parser.parse_args()
    torch.set_num_threads(1)
    network = load(default_name("foreground"), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    pictures = chain(rendered(args.scenes, args.textures), photographed(args.labelled, args.empty_pictures))
    seen = [observe(picture, network, settings) for picture in pictures]
    table = fit(seen)
    made = {"command": "python -m models.training.instances.lookalikes", "pictures": len(seen), "seed": _SEED,
            "network": f"{network.spec.name} {network.spec.sha256[:12]}"}  # fmt: skip
    lookalikes.COEFFICIENTS.write_text(tomli_w.dumps({"made_by": made} | table))
    print(table)


if __name__ == "__main__":
    main()
