"""Fit what tells cables from their lookalikes: ``python -m models.training.instances.lookalikes
--textures PACK``.

Rendered scenes of tables and of workshops, photographs with marked cables and photographs without
any, each at three sizes, go through the foreground network and the default method; an instance is a
cable when most of its centerline lies on one. Two thirds of the pictures are fitted; the figures
are of the others. Writes ``lookalikes.toml``.
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
import torch.nn.functional as F
from torch import nn

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.sampling import read_nearest
from models.instances import lookalikes
from models.instances.likeness import Likeness, likeness
from models.instances.lookalikes import Calibration
from models.instances.section_matching import extract
from models.segmentation.effort import look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.synthesis.scenes import WORKSHOP, SceneParams, render_scene, to_uint8
from models.synthesis.textures import load_pool
from models.training.foreground.augmentation import UNKNOWN
from models.training.foreground.real_pictures import load_empty, load_labelled
from models.training.instances.confidence import calibration_error
from models.weights.inference import Network, Runtime, default_name, eight_bit, load

_SEED = 771
_HIDDEN, _STEPS = 32, 800
_PHOTOGRAPHS = 2.0
"""An instance of a photograph counts as many of a render: these are many, those are what is to be
told apart."""
_SIZES = (1.0, 0.6, 1.3)
_LOST = 0.01
"""Share of the true cables that may leave the foreground beside others."""
_TABLE = SceneParams((360, 640))
_WORKSHOP = replace(WORKSHOP, size=(360, 640), empty_share=0.25)
_KINDS = (_TABLE, _WORKSHOP, replace(_WORKSHOP, empty_share=0.6))


class Labelled(NamedTuple):
    """``image`` (H, W, 3); ``labels`` (H, W): 255 cable, 0 none, 128 cannot tell; ``source``:
    pictures of one are fitted together or not at all."""

    image: ByteArray
    labels: ByteArray
    source: str


class Seen(NamedTuple):
    """Of the instances of one source of which one can tell: ``rows`` (I, features), ``cable`` (I,)
    whether each is one, ``weight`` (I,)."""

    rows: FloatArray
    cable: BoolArray
    weight: FloatArray


def rendered(count: int, textures: Path | None) -> Iterator[Labelled]:
    pool = load_pool(textures)
    for k in range(count):
        scene = render_scene(np.random.default_rng([_SEED, k]), _KINDS[k % len(_KINDS)], pool)
        yield Labelled(
            to_uint8(scene.rgb),
            np.where(scene.ids.numpy() > 0, 255, 0).astype(np.uint8),
            f"render {k}",
        )


def photographed(labelled: Path | None, empty: Path | None) -> Iterator[Labelled]:
    for folder, read in ((labelled, load_labelled), (empty, load_empty)):
        if folder is not None:
            yield from (
                _resized(p.rgb, p.labels, size, p.name)
                for p in read(folder).photographs
                for size in _SIZES
            )


def _resized(image: ByteArray, labels: ByteArray, size: float, name: str) -> Labelled:
    way = cv2.INTER_AREA if size < 1 else cv2.INTER_LINEAR
    picture = np.asarray(cv2.resize(image, None, fx=size, fy=size, interpolation=way), np.uint8)
    nearest = cv2.resize(labels, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    return Labelled(picture, np.asarray(nearest, np.uint8), f"photograph {name}")


def observe(picture: Labelled, network: Network, settings: ForegroundInput) -> Seen:
    """What is found in a picture, and what of it is true."""
    probability = look(picture.image, network, settings)
    mask = foreground_mask(probability, settings)
    scene = extract(mask, picture.image)
    if not scene.instances:
        return Seen(np.zeros((0, len(Likeness._fields))), np.zeros(0, bool), np.zeros(0))
    marked = cv2.dilate((picture.labels == 255).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    known = [read_nearest(picture.labels != UNKNOWN, i.centerline_xy) > 0 for i in scene.instances]
    on = [
        read_nearest(marked, i.centerline_xy)[k]
        for i, k in zip(scene.instances, known, strict=True)
    ]
    told = np.array([k.mean() > 0.5 for k in known])
    cable = np.array([len(values) > 0 and values.mean() > 0.5 for values in on])
    rows = likeness(scene, probability, mask, picture.image).rows()
    weight = np.full(
        int(told.sum()), _PHOTOGRAPHS if picture.source.startswith("photograph") else 1.0
    )
    return Seen(rows[told], cable[told], weight)


def fit(seen: list[Seen]) -> dict[str, object]:
    """The network and its figures, as ``lookalikes.toml`` has them; the order of the sources does
    not matter."""
    order = np.random.default_rng(_SEED).permutation(len(seen))
    cut = len(order) * 2 // 3
    fitted, held = (_joined([seen[k] for k in part]) for part in (order[:cut], order[cut:]))
    rule = _learnt(fitted)
    likely = rule.chance(fitted.rows)
    rule = replace(rule, least=round(float(np.quantile(likely[fitted.cable], _LOST)), 4))
    return _table(rule) | {"held_out": _figures(rule, held)}


def _learnt(seen: Seen) -> Calibration:
    mean, scale = seen.rows.mean(axis=0), seen.rows.std(axis=0) + 1e-6
    torch.manual_seed(_SEED)
    first, last = nn.Linear(len(mean), _HIDDEN), nn.Linear(_HIDDEN, 1)
    network = nn.Sequential(first, nn.Tanh(), nn.Dropout(0.4), last)
    rows = torch.tensor(
        np.clip((seen.rows - mean) / scale, -lookalikes.FARTHEST, lookalikes.FARTHEST)
    ).float()
    cable, weight = (
        torch.tensor(seen.cable).float(),
        torch.tensor(seen.weight / seen.weight.mean()).float(),
    )
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-2, weight_decay=0.3)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, _STEPS)
    for _ in range(_STEPS):
        loss = F.binary_cross_entropy_with_logits(network(rows)[:, 0], cable, weight)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        falling.step()
    hidden, bias, out = (
        t.detach().numpy().astype(float) for t in (first.weight.T, first.bias, last.weight[0])
    )
    return Calibration(mean, scale, hidden, bias, out, float(last.bias.detach()), 0.0)


def _table(rule: Calibration) -> dict[str, object]:
    columns = zip(Likeness._fields, rule.mean, rule.scale, rule.hidden, strict=True)
    evidence = {
        name: {
            "mean": round(float(mean), 4),
            "scale": round(float(scale), 4),
            "hidden": hidden.round(4).tolist(),
        }
        for name, mean, scale, hidden in columns
    }
    ends = {
        "bias": rule.bias.round(4).tolist(),
        "out": rule.out.round(4).tolist(),
        "offset": round(rule.offset, 4),
    }
    return {"least": rule.least, **ends, "evidence": evidence}


def _figures(rule: Calibration, held: Seen) -> dict[str, object]:
    """Shares of the cables, and of what is none, that leave the foreground beside a cable, and the
    scene in company."""
    real = rule.chance(held.rows)
    figures: dict[str, object] = {"instances": len(held.cable), "cables": int(held.cable.sum())}
    for where, limit in (("", rule.least), ("_in_company", max(rule.least, lookalikes.IN_COMPANY))):
        figures |= {
            f"cables_left_out{where}": round(float((real[held.cable] < limit).mean()), 4),
            f"others_left_out{where}": round(float((real[~held.cable] < limit).mean()), 4),
        }
    return figures | {"calibration_error": round(calibration_error(real, held.cable), 4)}


def _joined(parts: list[Seen]) -> Seen:
    return Seen(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--textures", type=Path, help="a pack of background pictures; without it they are noise"
    )
    parser.add_argument(
        "--labelled", type=Path, help="folder with imgs/ and masks/ of marked photographs"
    )
    parser.add_argument("--empty-pictures", type=Path, help="folder of photographs without cables")
    parser.add_argument("--scenes", type=int, default=1400)
    args = parser.parse_args()
    torch.set_num_threads(1)
    network = load(eight_bit(default_name("foreground")), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    sources: dict[str, list[Seen]] = {}
    for picture in chain(
        photographed(args.labelled, args.empty_pictures), rendered(args.scenes, args.textures)
    ):
        sources.setdefault(picture.source, []).append(observe(picture, network, settings))
    seen = [_joined(parts) for parts in sources.values()]
    table = fit(seen)
    made = {
        "command": "python -m models.training.instances.lookalikes",
        "pictures": len(seen),
        "seed": _SEED,
        "network": f"{network.spec.name} {network.spec.sha256[:12]}",
    }
    lookalikes.COEFFICIENTS.write_text(tomli_w.dumps({"made_by": made} | table))
    print(table)


if __name__ == "__main__":
    main()
