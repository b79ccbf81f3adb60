"""Train RT-DLO's orientation network on patches it makes itself, and export it.

    python -m models.training.instances.rt_dlo_orientation

A few minutes on one core. The state is kept in ``--state`` after every epoch, and a second start goes on from
it. The same seed gives the same network on the same machine. Prints one JSON line: configuration and metrics.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import FloatArray
from models.instances.published.rt_dlo.orientation import CLASSES, PATCH_SIZE, angles_from_scores, principal_angles
from models.training.export import Card, export
from models.training.instances.rt_dlo_network_orientation import OrientationNetwork, OrientationProbabilities
from models.training.instances.rt_dlo_patches import make_patches
from models.training.state import restore, save

NAME = "rt_dlo_orientation"


@dataclass(frozen=True)
class TrainConfig:
    """Patches are made anew every epoch; the held-out ones come from another seed."""

    seed: int = 7
    epochs: int = 24
    patches_per_epoch: int = 60_000
    held_out: int = 20_000
    batch: int = 256
    learning_rate: float = 3e-3
    label_sigma_deg: float = 4.0


def encode_angles(angles: FloatArray, sigma_deg: float) -> Tensor:
    """``(n,)`` radians to ``(n, 180)`` targets: a periodic Gaussian of height 1 around the angle."""
    away = np.abs(np.arange(CLASSES)[None] - np.rad2deg(angles)[:, None])
    away = np.minimum(away, CLASSES - away)
    return torch.from_numpy(np.exp(-(away**2) / (2 * sigma_deg**2)).astype(np.float32))


def angular_errors_deg(predicted: FloatArray, true: FloatArray) -> FloatArray:
    """``(n,)`` differences of two undirected orientations, 0 to 90 degrees."""
    away = np.mod(np.rad2deg(predicted - true), 180.0)
    out: FloatArray = np.minimum(away, 180.0 - away)
    return out


def train(config: TrainConfig, state_path: Path) -> OrientationNetwork:
    """The trained network, in evaluation mode."""
    torch.manual_seed(config.seed)
    network = OrientationNetwork()
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.epochs)
    stateful = {"network": network, "optimizer": optimizer, "schedule": schedule}
    for epoch in range(restore(state_path, asdict(config), stateful), config.epochs):
        loss = _train_epoch(network, optimizer, config, epoch)
        schedule.step()
        save(state_path, asdict(config), stateful, epoch + 1)
        print(f"epoch {epoch + 1}/{config.epochs} loss {loss:.4f}", flush=True)
    return network.eval()


def _train_epoch(
    network: OrientationNetwork, optimizer: torch.optim.Optimizer, config: TrainConfig, epoch: int
) -> float:
    rng = np.random.default_rng([config.seed, epoch])
    patches, angles = make_patches(config.patches_per_epoch, rng)
    order = rng.permutation(len(patches))
    network.train()
    losses = []
    for start in range(0, len(order), config.batch):
        rows = order[start : start + config.batch]
        targets = encode_angles(angles[rows], config.label_sigma_deg)
        loss = nn.functional.binary_cross_entropy_with_logits(network(torch.from_numpy(patches[rows])), targets)
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        losses.append(loss.item())
    return float(np.mean(losses))


def evaluate(network: OrientationNetwork, config: TrainConfig) -> dict[str, float]:
    """Errors in degrees on patches that training did not see, beside those of the main axis, no network."""
    patches, angles = make_patches(config.held_out, np.random.default_rng([config.seed, 10**6]))
    with torch.inference_mode():
        predicted = angles_from_scores(network(torch.from_numpy(patches)).numpy())
    metrics = {}
    for name, guess in (("network", predicted), ("main_axis", principal_angles(patches))):
        errors = angular_errors_deg(guess, angles)
        metrics[f"{name}_mean_deg"] = round(float(errors.mean()), 3)
        metrics[f"{name}_median_deg"] = round(float(np.median(errors)), 3)
        metrics[f"{name}_over_20_deg"] = round(float((errors > 20).mean()), 4)
    return metrics


def export_network(network: OrientationNetwork, config: TrainConfig, metrics: dict[str, float]) -> float:
    """Write the ONNX file and its manifest entry; returns the largest difference to torch."""
    card = Card(
        version="1.0",
        task="orientation",
        default=True,
        input=f"(n, {PATCH_SIZE}, {PATCH_SIZE}) float32: distance transform around a vertex, in radii",
        license="Apache-2.0",
        origin="trained from scratch on masks of random strands that training draws itself",
        preprocess={"patch_size": PATCH_SIZE, "classes": CLASSES},
        training=asdict(config),
        metrics=metrics,
    )
    rng = torch.Generator().manual_seed(config.seed)
    examples = [torch.rand(n, PATCH_SIZE, PATCH_SIZE, generator=rng) for n in (2, 0, 1, 7, 300)]
    return export(OrientationProbabilities(network), NAME, card, examples, {0: torch.export.Dim("n")}, tolerance=1e-4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--state", type=Path, default=Path("build/train/rt_dlo_orientation.pt"))
    parser.add_argument("--seed", type=int, default=TrainConfig.seed)
    parser.add_argument("--epochs", type=int, default=TrainConfig.epochs)
    args = parser.parse_args()
    config = TrainConfig(seed=args.seed, epochs=args.epochs)
    torch.set_num_threads(1)
    network = train(config, args.state)
    metrics = evaluate(network, config)
    difference = export_network(network, config, metrics)
    print(json.dumps({"config": asdict(config), "metrics": metrics, "onnx_difference": difference}))


if __name__ == "__main__":
    main()
