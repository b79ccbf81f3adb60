"""Train TripletNet and CrossNet of Ariadne+ on rendered crossings, and export them.

    python -m models.training.instances.ariadne_plus_networks [--textures PACK] [--only triplet|cross]

About half an hour on one core. The rendered crossings and the states are kept under ``--state``: a second start
goes on. Prints one JSON line a network.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.geometry.arrays import Float32Array
from models.instances.published.ariadne_plus.patches import (
    CROSSING_PIXELS,
    NODE_PIXELS,
    only,
    patch,
    reduction,
    to_network,
)
from models.synthesis.crossings import RenderedCrossing, crossings_kept
from models.training.export import Card, export
from models.training.instances.ariadne_plus_network_residual import WIDTH_FACTOR, AboveProbability, CrossNet, TripletNet
from models.training.state import restore, save

TRIPLET, CROSS = "ariadne_plus_triplet", "ariadne_plus_cross"


@dataclass(frozen=True)
class TrainConfig:
    """``crossings`` are rendered once; every epoch draws the patches anew."""

    seed: int = 11
    crossings: int = 7000
    held_out: int = 1000
    epochs: int = 12
    batch: int = 64
    learning_rate: float = 2e-3
    margin: float = 0.5


Loss = Callable[[nn.Module, list[RenderedCrossing], np.random.Generator], Tensor]


def node_patches(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(2 k, 3, 32, 32)``: patches beside the crossing on the k strands; 2 i and 2 i + 1 are strand i's."""
    patches = []
    for strand in scene.strands:
        for side in (-1, 1):
            center = strand.at(side * (strand.width_px * rng.uniform(0.8, 1.6) + rng.uniform(2, 10)))
            center = center + rng.normal(0, 0.08 * strand.width_px, 2)
            patches.append(patch(scene.rgb, center, NODE_PIXELS, reduction(strand.width_px)))
    return to_network(patches)


def crossing_patches(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(k, 3, 64, 64)``: one per strand, the others blackened; the last strand is the upper one."""
    middles = np.array([strand.at(0.0) for strand in scene.strands])
    center = middles.mean(axis=0) + rng.normal(0, 2.0, 2)
    step = reduction(float(np.mean([s.width_px for s in scene.strands])))
    whole = patch(scene.rgb, center, CROSSING_PIXELS, step)
    patches = []
    for strand in scene.strands:
        line = (strand.xy[::4] - center) / step + (CROSSING_PIXELS - 1) / 2 + rng.normal(0, 0.6, 2)
        patches.append(only(whole, line, strand.width_px * rng.uniform(0.85, 1.15) / step))
    return to_network(patches)


def triplet_loss(margin: float) -> Loss:
    """Triplet loss of 3.3.6 over every side of every strand, with a random other strand as the negative."""

    def loss(network: nn.Module, scenes: list[RenderedCrossing], rng: np.random.Generator) -> Tensor:
        batches = [node_patches(scene, rng) for scene in scenes]
        embeddings = network(torch.from_numpy(np.concatenate(batches)))
        positive, negative, first = [], [], 0
        for rows in batches:
            for k in range(len(rows)):
                positive.append(first + (k ^ 1))
                negative.append(first + int(rng.choice([j for j in range(len(rows)) if j // 2 != k // 2])))
            first += len(rows)
        near = ((embeddings - embeddings[positive]) ** 2).sum(1)
        far = ((embeddings - embeddings[negative]) ** 2).sum(1)
        return F.relu(near - far + margin).mean()

    return loss


def cross_loss(network: nn.Module, scenes: list[RenderedCrossing], rng: np.random.Generator) -> Tensor:
    """Binary cross-entropy of 3.3.8."""
    batches = [crossing_patches(scene, rng) for scene in scenes]
    above = np.concatenate([np.arange(len(rows)) == len(rows) - 1 for rows in batches])
    logits = network(torch.from_numpy(np.concatenate(batches)))
    return F.binary_cross_entropy_with_logits(logits, torch.from_numpy(above.astype(np.float32)))


def train(network: nn.Module, loss_of: Loss, scenes: list[RenderedCrossing], config: TrainConfig, state: Path) -> None:
    """Fit ``network`` in place; it ends in evaluation mode."""
    steps = -(-len(scenes) // config.batch)
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, config.learning_rate, config.epochs * steps)
    parts = {"network": network, "optimizer": optimizer, "schedule": schedule}
    for epoch in range(restore(state, asdict(config), parts), config.epochs):
        rng = np.random.default_rng([config.seed, epoch])
        network.train()
        losses = []
        for rows in np.array_split(rng.permutation(len(scenes)), steps):
            loss = loss_of(network, [scenes[k] for k in rows], rng)
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
            schedule.step()
            losses.append(float(loss.detach()))
        save(state, asdict(config), parts, epoch + 1)
        print(f"epoch {epoch + 1}/{config.epochs} loss {np.mean(losses):.4f}", flush=True)
    network.eval()


def partner_right(network: nn.Module, scenes: list[RenderedCrossing]) -> float:
    """Share of patches whose nearest other patch is the other side of the same strand."""
    rng, right = np.random.default_rng(0), []
    for scene in scenes:
        with torch.inference_mode():
            embeddings = network(torch.from_numpy(node_patches(scene, rng)))
        apart = torch.cdist(embeddings, embeddings).fill_diagonal_(torch.inf)
        right.extend((apart.argmin(1) == torch.arange(len(apart)) ^ 1).tolist())
    return round(float(np.mean(right)), 4)


def top_right(network: nn.Module, scenes: list[RenderedCrossing]) -> float:
    """Share of crossings whose upper strand gets the highest probability."""
    rng, right = np.random.default_rng(0), []
    for scene in scenes:
        with torch.inference_mode():
            right.append(int(network(torch.from_numpy(crossing_patches(scene, rng))).argmax()) == scene.top)
    return round(float(np.mean(right)), 4)


def _card(task: str, config: TrainConfig, pixels: int, metrics: dict[str, float]) -> Card:
    return Card(
        version="1.0",
        task=task,
        default=True,
        input=f"(n, 3, {pixels}, {pixels}) float32 RGB, 0 to 1",
        license="Apache-2.0",
        origin="trained from scratch on crossings that this repository renders",
        preprocess={"pixels": pixels, "width_factor": WIDTH_FACTOR},
        training={"command": "python -m models.training.instances.ariadne_plus_networks", **asdict(config)},
        metrics=metrics,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--state", type=Path, default=Path("build/train"))
    parser.add_argument("--textures", type=Path, help="a pack of background pictures; without it they are noise")
    parser.add_argument("--only", choices=["triplet", "cross"])
    args = parser.parse_args()
    torch.set_num_threads(1)
    config = TrainConfig()
    scenes = crossings_kept(args.state, config.crossings, config.seed, args.textures)
    held_out, rest = scenes[: config.held_out], scenes[config.held_out :]
    count = torch.export.Dim("n")
    if args.only != "cross":
        torch.manual_seed(config.seed)
        triplet = TripletNet()
        train(triplet, triplet_loss(config.margin), rest, config, args.state / f"{TRIPLET}.pt")
        card = _card("triplet", config, NODE_PIXELS, {"partner_right": partner_right(triplet, held_out)})
        export(triplet, TRIPLET, card, [torch.rand(n, 3, 32, 32) for n in (4, 1, 7)], {0: count}, tolerance=1e-3)
        print(json.dumps({TRIPLET: dict(card.metrics)}), flush=True)
    if args.only != "triplet":
        torch.manual_seed(config.seed)
        cross = CrossNet()
        train(cross, cross_loss, rest, config, args.state / f"{CROSS}.pt")
        card = _card("above", config, CROSSING_PIXELS, {"top_right": top_right(cross, held_out)})
        export(AboveProbability(cross), CROSS, card, [torch.rand(n, 3, 64, 64) for n in (4, 1, 7)], {0: count}, 1e-3)
        print(json.dumps({CROSS: dict(card.metrics)}), flush=True)


if __name__ == "__main__":
    main()
