"""What a foreground network finds in rendered pictures that it never trains on, and what a rule
finds there.

``python -m models.training.foreground.validation NAME --textures PACK`` writes both into the
manifest.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from models.geometry.arrays import BoolArray, ByteArray
from models.segmentation.segment import ForegroundInput, segment
from models.synthesis.scenes import WORKSHOP, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool
from models.training.export import register
from models.training.foreground.learning import normalize
from models.training.foreground.networks import ForegroundNetwork
from models.weights.inference import WEIGHTS, load

_SEED = 10_000_019
_SHOWN = 12
RULE = "Otsu's threshold of the distance from the median color"


@torch.no_grad()
def validate(
    network: ForegroundNetwork, sheet: Path, pool: TexturePool, scenes: SceneParams, count: int = 64
) -> dict[str, float]:
    """Mean ``dice`` at 0.5 over pictures with cables, share of ``false`` pixels on pictures
    without; the first ones and what was found in them are drawn to ``sheet``."""
    dice, false, shown = [], [], []
    device = next(network.parameters()).device
    for k in range(count):
        scene = render_scene(np.random.default_rng([_SEED, k]), scenes, pool)
        image = (scene.rgb * 255).round().byte()[None]
        p = torch.sigmoid(network(normalize(image.to(device))))[0, 0].cpu()
        found, true = p > 0.5, scene.ids > 0
        if true.any():
            dice.append(float(2 * (found & true).sum() / (found.sum() + true.sum())))
        else:
            false.append(float(found.float().mean()))
        if k < _SHOWN:
            shown.append(torch.cat([scene.rgb, p.expand(3, -1, -1)], 2))
    _draw(shown, sheet)
    return {"dice": float(np.mean(dice)), "false": float(np.mean(false)) if false else 0.0}


def figures(
    mask: Callable[[ByteArray], BoolArray], pool: TexturePool, scenes: SceneParams, count: int
) -> dict[str, float]:
    """The same of any way to get a (H, W) mask of a picture (H, W, 3)."""
    dice, false = [], []
    for k in range(count):
        scene = render_scene(np.random.default_rng([_SEED, k]), scenes, pool)
        found, true = mask(to_uint8(scene.rgb)), scene.ids.numpy() > 0
        if true.any():
            total = int(np.count_nonzero(found)) + int(np.count_nonzero(true))
            dice.append(2 * int(np.count_nonzero(found & true)) / max(total, 1))
        else:
            false.append(found.mean())
    named = {
        "rendered_dice": float(np.mean(dice)),
        "rendered_false": float(np.mean(false)) if false else 0.0,
    }
    return {name: round(value, 4) for name, value in named.items()}


def by_color(rgb: ByteArray) -> BoolArray:
    """(H, W) what stands out of most of a picture (H, W, 3) by its color."""
    lab = cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB).astype(np.float32)
    away = np.linalg.norm(lab - np.median(lab, axis=(0, 1)), axis=2)
    levels = np.clip(away, 0, 255).astype(np.uint8)
    return np.asarray(cv2.threshold(levels, 0, 1, cv2.THRESH_BINARY + cv2.THRESH_OTSU)[1] > 0)


def _draw(tiles: list[Tensor], file: Path) -> None:
    rows = [torch.cat(tiles[i : i + 3], 2) for i in range(0, len(tiles) - 2, 3)]
    image = (torch.cat(rows, 1).clamp(0, 1) * 255).byte().permute(1, 2, 0).numpy()
    cv2.imwrite(str(file), image[:, :, ::-1])


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.validation", description=__doc__
    )
    parser.add_argument("name", help="of a network in the manifest")
    parser.add_argument("--textures", type=Path, help="pack or folder of backgrounds")
    parser.add_argument("--count", type=int, default=64)
    args = parser.parse_args()
    network, pool = load(args.name), load_pool(args.textures)
    spec = network.spec
    settings = ForegroundInput.from_manifest(spec.preprocess)
    scenes = replace(WORKSHOP, size=(spec.training["height"], spec.training["width"]))

    def seen(rgb: ByteArray) -> BoolArray:
        return np.asarray(segment(rgb, network, settings) >= settings.threshold)

    metrics = {**spec.metrics, **figures(seen, pool, scenes, args.count)}
    without = {"rule": RULE, **figures(by_color, pool, scenes, args.count)}
    register(
        args.name,
        WEIGHTS / spec.file,
        replace(spec, metrics=metrics, without=without),
        spec.parameters,
    )
    print(args.name, metrics, without)


if __name__ == "__main__":
    main()
