"""Ariadne+'s two networks (thesis 3.3.6, 3.3.8), trained on rendered crossings: 20 minutes on one
core each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.geometry.arrays import Float32Array, IntArray
from models.instances.published.ariadne_plus.patches import (
    CROSSING_PIXELS,
    NODE_PIXELS,
    only,
    patch,
    reduction,
    to_network,
)
from models.synthesis.crossings import RenderedCrossing
from models.training.export import Exported
from models.training.fit import Family
from models.training.instances.ariadne_plus_network_residual import (
    WIDTH_FACTOR,
    AboveProbability,
    CrossNet,
    TripletNet,
)
from models.training.instances.crossing_samples import CrossingConfig, Crossings, crossing_samples

TRIPLET, CROSS = "ariadne_plus_triplet", "ariadne_plus_cross"


@dataclass(frozen=True)
class AriadneConfig(CrossingConfig):
    """Every epoch draws the patches anew; ``margin`` of the triplet loss."""

    epochs: int = 12
    weight_decay: float = 1e-3
    warm_up: float = 0.3
    margin: float = 0.5


def node_patches(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(2 k, 3, 32, 32)``: patches beside the crossing on the k strands; 2 i and 2 i + 1 are
    strand i's."""
    patches = []
    for strand in scene.strands:
        for side in (-1, 1):
            center = strand.at(
                side * (strand.width_px * rng.uniform(0.8, 1.6) + rng.uniform(2, 10))
            )
            center = center + rng.normal(0, 0.08 * strand.width_px, 2)
            patches.append(patch(scene.rgb, center, NODE_PIXELS, reduction(strand.width_px)))
    return to_network(patches)


def crossing_patches(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(k, 3, 64, 64)``: one per strand, the others blackened; the last strand is the upper
    one."""
    middles = np.array([strand.at(0.0) for strand in scene.strands])
    center = middles.mean(axis=0) + rng.normal(0, 2.0, 2)
    step = reduction(float(np.mean([s.width_px for s in scene.strands])))
    whole = patch(scene.rgb, center, CROSSING_PIXELS, step)
    patches = []
    for strand in scene.strands:
        line = (strand.xy[::4] - center) / step + (CROSSING_PIXELS - 1) / 2 + rng.normal(0, 0.6, 2)
        patches.append(only(whole, line, strand.width_px * rng.uniform(0.85, 1.15) / step))
    return to_network(patches)


def triplet_loss(
    network: nn.Module,
    scenes: Crossings,
    rows: IntArray,
    rng: np.random.Generator,
    config: AriadneConfig,
) -> Tensor:
    """Triplet loss of 3.3.6 over every side of every strand, with a random other strand as the
    negative."""
    batches = [node_patches(scenes[k], rng) for k in rows]
    embeddings = network(torch.from_numpy(np.concatenate(batches)))
    positive, negative, first = [], [], 0
    for patches in batches:
        for k in range(len(patches)):
            positive.append(first + (k ^ 1))
            negative.append(
                first + int(rng.choice([j for j in range(len(patches)) if j // 2 != k // 2]))
            )
        first += len(patches)
    near = ((embeddings - embeddings[positive]) ** 2).sum(1)
    far = ((embeddings - embeddings[negative]) ** 2).sum(1)
    return F.relu(near - far + config.margin).mean()


def cross_loss(
    network: nn.Module,
    scenes: Crossings,
    rows: IntArray,
    rng: np.random.Generator,
    config: AriadneConfig,
) -> Tensor:
    """Binary cross-entropy of 3.3.8."""
    batches = [crossing_patches(scenes[k], rng) for k in rows]
    above = np.concatenate([np.arange(len(patches)) == len(patches) - 1 for patches in batches])
    logits = network(torch.from_numpy(np.concatenate(batches)))
    return F.binary_cross_entropy_with_logits(logits, torch.from_numpy(above.astype(np.float32)))


def partner_right(network: nn.Module, scenes: Crossings, config: AriadneConfig) -> dict[str, float]:
    """Share of patches whose nearest other patch is the other side of the same strand."""
    rng, right = np.random.default_rng(0), []
    for scene in scenes:
        with torch.inference_mode():
            embeddings = network(torch.from_numpy(node_patches(scene, rng)))
        apart = torch.cdist(embeddings, embeddings).fill_diagonal_(torch.inf)
        right.extend((apart.argmin(1) == torch.arange(len(apart)) ^ 1).tolist())
    return {"partner_right": round(float(np.mean(right)), 4)}


def top_right(network: nn.Module, scenes: Crossings, config: AriadneConfig) -> dict[str, float]:
    """Share of crossings whose upper strand gets the highest probability."""
    rng, right = np.random.default_rng(0), []
    for scene in scenes:
        with torch.inference_mode():
            right.append(
                int(network(torch.from_numpy(crossing_patches(scene, rng))).argmax()) == scene.top
            )
    return {"top_right": round(float(np.mean(right)), 4)}


def nearest_color(scenes: Crossings, config: AriadneConfig) -> dict[str, Any]:
    """What the triplet network replaces: the patch whose middle has the nearest mean color."""
    rng, right = np.random.default_rng(0), []
    inner = slice(NODE_PIXELS // 2 - 4, NODE_PIXELS // 2 + 4)
    for scene in scenes:
        colors = node_patches(scene, rng)[:, :, inner, inner].mean(axis=(2, 3))
        apart = np.linalg.norm(colors[:, None] - colors[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        right.extend(apart.argmin(axis=1) == np.arange(len(apart)) ^ 1)
    return {"rule": "nearest mean color", "partner_right": round(float(np.mean(right)), 4)}


def color_at_the_crossing(scenes: Crossings, config: AriadneConfig) -> dict[str, Any]:
    """What the crossing network replaces: on top is the strand whose color beside the crossing is
    nearest to the color at it."""
    rng, right = np.random.default_rng(0), []
    inner = slice(CROSSING_PIXELS // 2 - 2, CROSSING_PIXELS // 2 + 2)
    for scene in scenes:
        away = []
        for part in crossing_patches(scene, rng):
            seen = part[:, part.max(axis=0) > 0]
            beside = np.median(seen, axis=1) if seen.size else np.zeros(3)
            away.append(np.linalg.norm(part[:, inner, inner].mean(axis=(1, 2)) - beside))
        right.append(int(np.argmin(away)) == scene.top)
    return {"rule": "nearest color at the crossing", "top_right": round(float(np.mean(right)), 4)}


def _exported(name: str, module: nn.Module, task: str, pixels: int) -> list[Exported]:
    return [
        Exported(
            name,
            module,
            task,
            f"(n, 3, {pixels}, {pixels}) float32 RGB, 0 to 1",
            "trained from scratch on crossings that this repository renders",
            {"pixels": pixels, "width_factor": WIDTH_FACTOR},
            [(torch.rand(n, 3, pixels, pixels),) for n in (4, 1, 7)],
            [{0: torch.export.Dim("n")}],
            1e-3,
        )
    ]


TRIPLET_FAMILY = Family(
    TRIPLET,
    AriadneConfig,
    crossing_samples,
    lambda config, scenes: TripletNet(),
    triplet_loss,
    partner_right,
    nearest_color,
    lambda network, scenes, config: _exported(TRIPLET, network, "triplet", NODE_PIXELS),
    least={"partner_right": 0.4},  # one of three other patches is right by chance
)
CROSS_FAMILY = Family(
    CROSS,
    AriadneConfig,
    crossing_samples,
    lambda config, scenes: CrossNet(),
    cross_loss,
    top_right,
    color_at_the_crossing,
    lambda network, scenes, config: _exported(
        CROSS, AboveProbability(network), "above", CROSSING_PIXELS
    ),
    least={"top_right": 0.6},  # one of two strands is right by chance
)
