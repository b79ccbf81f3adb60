"""What a foreground network finds in rendered pictures that it never trains on, and what a rule finds there.

``python -m models.training.foreground.validation NAME --textures PACK`` notes the rule's figures in the manifest.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor

from models.geometry.arrays import BoolArray, ByteArray
from models.synthesis.scenes import WORKSHOP, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool
from models.training.export import note_without
from models.training.foreground.learning import normalize
from models.training.foreground.networks import ForegroundNetwork
from models.weights.inference import manifest

_SEED = 10_000_019
_SHOWN = 12


@torch.no_grad()
def validate(
    network: ForegroundNetwork, sheet: Path, pool: TexturePool, scenes: SceneParams, count: int = 64
) -> dict[str, float]:
    """Mean ``dice`` at 0.5 over pictures with cables, share of ``false`` pixels on pictures without; the first ones and
    what was found in them are drawn to ``sheet``."""
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


def without(pool: TexturePool, scenes: SceneParams, count: int = 64) -> dict[str, Any]:
    """The same figures without a network."""
    dice, false = [], []
    for k in range(count):
        scene = render_scene(np.random.default_rng([_SEED, k]), scenes, pool)
        found, true = by_color(to_uint8(scene.rgb)), scene.ids.numpy() > 0
        if true.any():
            dice.append(2 * np.count_nonzero(found & true) / max(np.count_nonzero(found) + np.count_nonzero(true), 1))
        else:
            false.append(found.mean())
    rule = "Otsu's threshold of the distance from the median color"
    figures = {"rendered_dice": float(np.mean(dice)), "rendered_false": float(np.mean(false)) if false else 0.0}
    return {"rule": rule, **{name: round(value, 4) for name, value in figures.items()}}


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
    parser = argparse.ArgumentParser(prog="python -m models.training.foreground.validation", description=__doc__)
    parser.add_argument("name", help="of a network in the manifest")
    parser.add_argument("--textures", type=Path, help="pack or folder of backgrounds")
    parser.add_argument("--count", type=int, default=64)
    args = parser.parse_args()
    trained = manifest()[args.name].training
    scenes = replace(WORKSHOP, size=(trained["height"], trained["width"]))
    figures = without(load_pool(args.textures), scenes, args.count)
    note_without(args.name, figures)
    print(args.name, figures)


if __name__ == "__main__":
    main()
