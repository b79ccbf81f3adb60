"""Train the networks of thesis 6.5 on harnesses that training makes itself, and export them.

    python -m models.training.topology.train

About 20 minutes on one core. Scenes are made once and kept beside ``--state``; the state is kept after every epoch and
a second start goes on from it. The same seed gives the same networks on the same machine. Prints one JSON line.
"""

from __future__ import annotations

import argparse
import json
import pickle
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import BoolArray
from models.synthesis.harness import HarnessParams
from models.synthesis.harness_masks import MaskParams
from models.topology.encodings import EDGE_FEATURES, NODE_FEATURES, PATCH, Encoded
from models.training.export import Card, export
from models.training.state import restore, save
from models.training.topology.graphs import Sample, encode_angles, make_sample
from models.training.topology.network_topology import TopologyNetwork, TopologyProbabilities

NAME = "topology"
SIZES = ((480, 640), (360, 640), (504, 896))


@dataclass(frozen=True)
class TrainConfig:
    """Thesis 6.8.1: about 1600 graphs for training, here twice as many; 280 held out, h = 32. Batches of 8 with a
    falling rate take the place of its 200 000 steps of 2 at 1e-3."""

    seed: int = 11
    scenes: int = 3200
    held_out: int = 280
    epochs: int = 10
    batch: int = 8
    learning_rate: float = 3e-3
    hidden: int = 32


@dataclass(frozen=True)
class Batch:
    """Several graphs as one, with its targets."""

    inputs: tuple[Tensor, Tensor, Tensor, Tensor]
    links: Tensor
    on: Tensor
    angles: Tensor
    classes: Tensor


def make_samples(seed: int, first: int, count: int) -> list[Sample]:
    """Scenes ``first`` to ``first + count`` of a seed; picture sizes take turns."""
    samples = []
    for k in range(first, first + count):
        params = HarnessParams(size=SIZES[k % len(SIZES)])
        samples.append(make_sample(np.random.default_rng([seed, k]), params, MaskParams()))
        if (k + 1) % 200 == 0:
            print(f"{k + 1 - first}/{count} scenes", flush=True)
    return samples


def collate(samples: Sequence[Sample]) -> Batch:
    """Several samples as one graph without edges between them."""
    offsets = np.cumsum([0, *(len(s.encoded.nodes) for s in samples[:-1])])
    encoded = [s.encoded for s in samples]
    edges = np.concatenate([e.edges + o for e, o in zip(encoded, offsets, strict=True)], axis=1)
    return Batch(
        (_tensor(encoded, "patches"), _tensor(encoded, "nodes"), torch.from_numpy(edges),
         _tensor(encoded, "edge_features")),
        torch.from_numpy(np.concatenate([s.truth.links for s in samples]).astype(np.float32)),
        torch.from_numpy(np.concatenate([s.truth.on for s in samples])),
        torch.from_numpy(encode_angles(np.concatenate([s.truth.angles for s in samples]))),
        torch.from_numpy(np.concatenate([s.truth.classes for s in samples]).astype(np.float32)),
    )  # fmt: skip


def _tensor(encoded: list[Encoded], name: str) -> Tensor:
    return torch.from_numpy(np.concatenate([getattr(e, name) for e in encoded]))


def loss_of(network: TopologyNetwork, batch: Batch) -> Tensor:
    """Eq. 6.1 plus the classifier's loss. The rare class of nodes weighs more, in place of leaving others out."""
    links, orientations, classes = network(*batch.inputs)
    entropy = nn.functional.binary_cross_entropy_with_logits
    link_loss = entropy(links, batch.links)
    angle_loss = entropy(orientations[batch.on], batch.angles[batch.on])
    class_loss = entropy(classes, batch.classes, pos_weight=torch.tensor(4.0))
    total: Tensor = link_loss + angle_loss + class_loss
    return total


def train(config: TrainConfig, samples: list[Sample], state: Path) -> TopologyNetwork:
    """The trained network, in evaluation mode."""
    torch.manual_seed(config.seed)
    network = TopologyNetwork(config.hidden)
    optimizer = torch.optim.Adam(network.parameters(), lr=config.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.epochs)
    parts = {"network": network, "optimizer": optimizer, "schedule": schedule}
    for epoch in range(restore(state, asdict(config), parts), config.epochs):
        order = np.random.default_rng([config.seed, epoch]).permutation(len(samples))
        network.train()
        losses = []
        for start in range(0, len(order), config.batch):
            loss = loss_of(network, collate([samples[k] for k in order[start : start + config.batch]]))
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimizer.step()
            losses.append(loss.item())
        schedule.step()
        save(state, asdict(config), parts, epoch + 1)
        print(f"epoch {epoch + 1}/{config.epochs} loss {np.mean(losses):.4f}", flush=True)
    return network.eval()


def evaluate(network: TopologyNetwork, samples: list[Sample]) -> dict[str, float]:
    """On scenes that training did not see: Dice of the links at 0.5, orientation errors, Dice of the classes."""
    batch = collate(samples)
    with torch.inference_mode():
        links, orientations, classes = network(*batch.inputs)
    angles = np.argmax(orientations.numpy(), axis=1)[batch.on.numpy()]
    true = np.argmax(batch.angles.numpy(), axis=1)[batch.on.numpy()]
    error = np.abs(angles - true)
    error = np.minimum(error, 180 - error)
    metrics = {
        "link_dice": _dice(links.numpy() > 0, batch.links.numpy() > 0),
        "orientation_median_deg": float(np.median(error)),
        "orientation_mean_deg": float(error.mean()),
        "branch_dice": _dice(classes[:, 0].numpy() > 0, batch.classes[:, 0].numpy() > 0),
        "crossing_dice": _dice(classes[:, 1].numpy() > 0, batch.classes[:, 1].numpy() > 0),
    }
    return {name: round(value, 4) for name, value in metrics.items()}


def _dice(found: BoolArray, true: BoolArray) -> float:
    both, either = int((found & true).sum()), int(found.sum()) + int(true.sum())
    return 2 * both / max(either, 1)


def export_network(network: TopologyNetwork, config: TrainConfig, metrics: dict[str, float]) -> float:
    """Write the ONNX file and its manifest entry; returns the largest difference to torch."""
    card = Card(
        version="1.0",
        task="topology",
        default=True,
        input=f"patches (n, {PATCH}, {PATCH}), nodes (n, {NODE_FEATURES}), edges (2, e) int64, "
        f"edge_features (e, {EDGE_FEATURES})",
        license="Apache-2.0",
        origin="trained from scratch on masks of random harnesses that training draws itself",
        preprocess={"patch_size": PATCH},
        training=asdict(config),
        metrics=metrics,
    )
    n, e = torch.export.Dim("nodes"), torch.export.Dim("edges")
    cases = [_example(nodes, edges, config.seed) for nodes, edges in ((60, 270), (2, 1), (3, 0), (700, 3000))]
    return export(
        TopologyProbabilities(network), NAME, card, cases, [{0: n}, {0: n}, {1: e}, {0: e}], 1e-3,
        ("patches", "nodes", "edges", "edge_features"), ("links", "orientations", "classes"),
    )  # fmt: skip


def _example(nodes: int, edges: int, seed: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    rng = torch.Generator().manual_seed(seed + nodes)
    return (
        torch.rand(nodes, PATCH, PATCH, generator=rng),
        torch.rand(nodes, NODE_FEATURES, generator=rng),
        torch.randint(0, nodes, (2, edges), generator=rng),
        torch.rand(edges, EDGE_FEATURES, generator=rng),
    )


def scenes(config: TrainConfig, folder: Path) -> tuple[list[Sample], list[Sample]]:
    """Training and held-out scenes; those for training are kept in ``folder``."""
    file = folder / f"scenes-{config.seed}-{config.scenes}.pickle"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        file.write_bytes(pickle.dumps(make_samples(config.seed, 0, config.scenes)))
    samples: list[Sample] = pickle.loads(file.read_bytes())
    return samples, make_samples(config.seed, 10**6, config.held_out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--state", type=Path, default=Path("build/train/topology.pt"))
    parser.add_argument("--seed", type=int, default=TrainConfig.seed)
    parser.add_argument("--epochs", type=int, default=TrainConfig.epochs)
    args = parser.parse_args()
    config = TrainConfig(seed=args.seed, epochs=args.epochs)
    torch.set_num_threads(1)
    samples, held_out = scenes(config, args.state.parent)
    network = train(config, samples, args.state)
    metrics = evaluate(network, held_out)
    difference = export_network(network, config, metrics)
    print(json.dumps({"config": asdict(config), "metrics": metrics, "onnx_difference": difference}))


if __name__ == "__main__":
    main()
