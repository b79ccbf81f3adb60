"""Train FASTDLO's similarity network with a triplet loss on rendered crossings, and export it.

    python -m models.training.instances.fastdlo_similarity [--textures PACK]

Two minutes on one core. The rendered crossings and the state are kept under ``--state``. Prints one JSON line.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import Float32Array
from models.instances.published.fastdlo.similarity import FEATURES, features, probabilities
from models.synthesis.crossings import RenderedCrossing, crop, crossings_kept
from models.training.export import Card, export
from models.training.instances.fastdlo_network_similarity import EMBEDDING, SimilarityNetwork
from models.training.state import restore, save

NAME = "fastdlo_similarity"
_WIDTH_NOISE, _ANGLE_NOISE = 0.2, np.deg2rad(12.0)


@dataclass(frozen=True)
class TrainConfig:
    """``crossings`` are rendered once; where on them the endpoints lie is drawn anew for each of ``epochs``."""

    seed: int = 11
    crossings: int = 7000
    held_out: int = 1000
    epochs: int = 25
    batch: int = 512
    learning_rate: float = 2e-3
    margin: float = 1.0


def endpoints_of(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(2 k, 6)`` features at both sides of the crossing of the k strands; rows 2 i and 2 i + 1 are strand i's.

    Endpoints lie up to three widths away; width and direction get the errors that a mask leaves.
    """
    colors, widths, outward = [], [], []
    for strand in scene.strands:
        for side in (-1, 1):
            offset = side * strand.width_px * rng.uniform(0.8, 3.0)
            patch = crop(scene.rgb, strand.at(offset), max(1, round(0.5 * strand.width_px)), 3)
            colors.append(np.median(patch.reshape(-1, 3), axis=0))
            widths.append(strand.width_px * np.exp(rng.normal(0, _WIDTH_NOISE)))
            (x, y), turn = strand.outward(offset), rng.normal(0, _ANGLE_NOISE)
            outward.append((x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)))
    return features(np.array(colors), np.array(widths), np.array(outward))


def triplets(scenes: list[RenderedCrossing], rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """``(n, 6)`` anchors, positives (other side of the strand), negatives (other strands of the crossing)."""
    anchors, positives, negatives = [], [], []
    for scene in scenes:
        rows = endpoints_of(scene, rng)
        for k in range(len(rows)):
            others = [j for j in range(len(rows)) if j // 2 != k // 2]
            anchors.append(rows[k])
            positives.append(rows[k ^ 1])
            negatives.append(rows[rng.choice(others)])
    return tuple(torch.from_numpy(np.stack(part)) for part in (anchors, positives, negatives))  # type: ignore


def train(scenes: list[RenderedCrossing], config: TrainConfig, state: Path) -> SimilarityNetwork:
    """The trained network, in evaluation mode."""
    torch.manual_seed(config.seed)
    network = SimilarityNetwork()
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.epochs)
    parts = {"network": network, "optimizer": optimizer, "schedule": schedule}
    loss_of = nn.TripletMarginWithDistanceLoss(
        distance_function=lambda a, b: ((a - b) ** 2).sum(1), margin=config.margin
    )
    for epoch in range(restore(state, asdict(config), parts), config.epochs):
        rng = np.random.default_rng([config.seed, epoch])
        anchors, positives, negatives = triplets(scenes, rng)
        for rows in torch.from_numpy(rng.permutation(len(anchors))).split(config.batch):
            loss = loss_of(network(anchors[rows]), network(positives[rows]), network(negatives[rows]))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        schedule.step()
        save(state, asdict(config), parts, epoch + 1)
        print(f"epoch {epoch + 1}/{config.epochs} loss {float(loss.detach()):.4f}", flush=True)
    return network.eval()


def evaluate(network: SimilarityNetwork, scenes: list[RenderedCrossing]) -> dict[str, float]:
    """Share of endpoints whose most probable partner is the other side of their strand; mean probabilities."""
    rng = np.random.default_rng(0)
    right: list[bool] = []
    same: list[float] = []
    other: list[float] = []
    for scene in scenes:
        with torch.inference_mode():
            embedded = network(torch.from_numpy(endpoints_of(scene, rng))).numpy()
        table = probabilities(embedded[:, None] - embedded[None])
        np.fill_diagonal(table, -1)
        rows = np.arange(len(table))
        right.extend(table.argmax(axis=1) == rows ^ 1)
        same.extend(table[rows, rows ^ 1])
        other.extend(table[rows, (rows + 2) % len(rows)])
    named: dict[str, list[Any]] = {"partner_right": right, "same_strand": same, "other_strand": other}
    return {name: round(float(np.mean(values)), 4) for name, values in named.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--state", type=Path, default=Path("build/train"))
    parser.add_argument("--textures", type=Path, help="a pack of background pictures; without it they are noise")
    args = parser.parse_args()
    torch.set_num_threads(1)
    config = TrainConfig()
    scenes = crossings_kept(args.state, config.crossings, config.seed, args.textures)
    network = train(scenes[config.held_out :], config, args.state / f"{NAME}.pt")
    metrics = evaluate(network, scenes[: config.held_out])
    card = Card(
        version="1.0",
        task="similarity",
        default=True,
        input=f"(n, {FEATURES}) float32: RGB 0 to 1, log relative width, cos and sin of twice the direction",
        license="Apache-2.0",
        origin="trained from scratch on crossings that this repository renders",
        preprocess={"embedding": EMBEDDING},
        training={"command": "python -m models.training.instances.fastdlo_similarity", **asdict(config)},
        metrics=metrics,
    )
    examples = [torch.rand(n, FEATURES) for n in (4, 0, 1, 7)]
    export(network, NAME, card, examples, {0: torch.export.Dim("n")}, tolerance=1e-4)
    print(json.dumps(metrics))


if __name__ == "__main__":
    main()
