"""What a foreground network finds in rendered pictures that it never trains on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from models.synthesis.scenes import SceneParams, render_scene
from models.synthesis.textures import TexturePool
from models.training.foreground.learning import normalize
from models.training.foreground.networks import ForegroundNetwork

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


def _draw(tiles: list[Tensor], file: Path) -> None:
    rows = [torch.cat(tiles[i : i + 3], 2) for i in range(0, len(tiles) - 2, 3)]
    image = (torch.cat(rows, 1).clamp(0, 1) * 255).byte().permute(1, 2, 0).numpy()
    cv2.imwrite(str(file), image[:, :, ::-1])
