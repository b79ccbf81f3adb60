"""Train the network that tells crossings from branch-points by the evidence at each site, and export it.

    python -m models.topology.train_junctions

Needs the exported ``topology`` network: what it says of the nodes is part of the evidence. The scenes are those of
``models.topology.train``, kept beside its state. About a minute. Prints one JSON line.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from models.export import Card, export
from models.geometry.arrays import BoolArray, Float32Array
from models.inference import Runtime, load
from models.topology.extraction import TopologyNetwork, predict
from models.topology.network_topology import JunctionNetwork
from models.topology.repair import repaired
from models.topology.sites import EVIDENCE, Site, crossing_sites, evidence
from models.topology.skeleton import Web
from models.topology.train import TrainConfig, scenes
from models.topology.train_graphs import Sample
from models.topology.train_harness import Harness

NAME = "topology_junctions"


@dataclass(frozen=True)
class JunctionConfig:
    """``jitter``: noise on the evidence, in its standard deviations: there are few sites to learn from."""

    seed: int = 5
    epochs: int = 120
    batch: int = 64
    learning_rate: float = 3e-3
    weight_decay: float = 0.05
    jitter: float = 0.15


class JunctionProbabilities(nn.Module):
    """What is exported: the network followed by the sigmoid that its loss implies."""

    def __init__(self, network: JunctionNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, sites: Tensor) -> Tensor:
        """``(n, 17)`` evidence to ``(n,)`` probabilities of a crossing."""
        return torch.sigmoid(self.network(sites))


def table_of(samples: list[Sample], network: TopologyNetwork) -> tuple[Float32Array, BoolArray]:
    """Evidence ``(n, 17)`` of all sites of the scenes, and whether each is a crossing."""
    rows, truths = [], []
    for sample in samples:
        predictions = predict(sample.graph, network)
        web = repaired(sample.graph, predictions)
        for site in crossing_sites(web):
            rows.append(evidence(site, web, sample.graph.xy, predictions))
            truths.append(is_crossing(site, web, sample.harness))
    return np.array(rows, np.float32).reshape(-1, EVIDENCE), np.array(truths, bool)


def is_crossing(site: Site, web: Web, harness: Harness) -> bool:
    """Whether a true crossing lies at the middle of the site."""
    width = max(a.width for a in site.arms)
    length = web.strands[site.middle].length if site.middle is not None else 0.0
    reach = max(0.35 * length, 0.8 * width, 6.0)
    return any(np.hypot(*(m.xy - site.xy)) <= reach for m in harness.crossings)


def train(config: JunctionConfig, rows: Float32Array, truths: BoolArray) -> JunctionNetwork:
    """The trained network, in evaluation mode."""
    torch.manual_seed(config.seed)
    network = JunctionNetwork(EVIDENCE)
    network.mean = torch.from_numpy(rows.mean(axis=0))
    network.scale = torch.from_numpy(rows.std(axis=0) + 1e-3)
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.epochs)
    inputs, targets = torch.from_numpy(rows), torch.from_numpy(truths.astype(np.float32))
    spread = config.jitter * network.scale
    for epoch in range(config.epochs):
        order = np.random.default_rng([config.seed, epoch]).permutation(len(rows))
        for start in range(0, len(order), config.batch):
            chosen = order[start : start + config.batch]
            noisy = inputs[chosen] + spread * torch.randn(len(chosen), EVIDENCE)
            loss = nn.functional.binary_cross_entropy_with_logits(network(noisy), targets[chosen])
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
        schedule.step()
    return network.eval()


def evaluate(network: JunctionNetwork, rows: Float32Array, truths: BoolArray) -> dict[str, float]:
    with torch.inference_mode():
        found = network(torch.from_numpy(rows)).numpy() > 0
    right = float((found == truths).mean())
    return {
        "accuracy": round(right, 4),
        "crossings_right": round(float(found[truths].mean()), 4),
        "others_right": round(float((~found[~truths]).mean()), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, default=Path("build/train"))
    parser.add_argument("--seed", type=int, default=JunctionConfig.seed)
    args = parser.parse_args()
    config = JunctionConfig(seed=args.seed)
    torch.set_num_threads(1)
    samples, held_out = scenes(TrainConfig(), args.scenes)
    topology = load("topology", Runtime(threads=1))
    rows, truths = table_of(samples, topology)
    network = train(config, rows, truths)
    metrics = evaluate(network, *table_of(held_out, topology))
    card = Card(
        version="1.0",
        task="junctions",
        default=True,
        input=f"(n, {EVIDENCE}) float32: evidence at places where strands meet",
        license="Apache-2.0",
        origin="trained from scratch on masks of random harnesses that training draws itself",
        preprocess={"evidence": EVIDENCE},
        training={**asdict(config), "sites": len(rows), "crossings": int(truths.sum())},
        metrics=metrics,
    )
    rng = torch.Generator().manual_seed(config.seed)
    examples: list[Tensor | tuple[Tensor, ...]] = [torch.rand(n, EVIDENCE, generator=rng) for n in (2, 0, 1, 40)]
    dynamic = {0: torch.export.Dim("n")}
    difference = export(JunctionProbabilities(network), NAME, card, examples, dynamic, 1e-4, ("sites",), ("crossing",))
    print(json.dumps({"metrics": metrics, "sites": len(rows), "onnx_difference": difference}))


if __name__ == "__main__":
    main()
