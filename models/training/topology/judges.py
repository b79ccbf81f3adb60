"""Train the judges: crossing, lens or branch-points, gap or end, branch or stub, by the evidence there; export them.

    python -m models.training.topology.judges

Needs the exported ``topology`` network: what it says of nodes and links is part of the evidence. The scenes are others
than it was trained on. Stubs come first, then bridges between what is left, then crossings of what is repaired.
About 15 minutes on one core. Prints one JSON line a network.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import Float32Array
from models.topology.classifiers import Judge, Judges
from models.topology.sites import Reading
from models.training.export import Card, export
from models.training.topology.evidence import Table, bridge_table, crossing_table, scenes, stub_table
from models.training.topology.network_topology import JunctionNetwork
from models.weights.inference import Runtime, load

BRIDGES, STUBS, CROSSINGS = "topology_bridges", "topology_stubs", "topology_junctions"
MOVES = "topology_moves"
_SUBJECTS = {
    BRIDGES: ("bridges", "evidence of places where a strand may go on over a gap", ("end", "gap")),
    STUBS: ("stubs", "evidence of short strands", ("stub", "branch")),
    CROSSINGS: ("junctions", "evidence at places where strands meet", tuple(r.name.lower() for r in Reading)),
    MOVES: ("moves", "evidence of turns about a place that is held", ("fails", "works")),
}
"""Task, what the rows are, and the readings that the network tells apart."""
_FIRST, _HELD_OUT = 5 * 10**5, 10**6


@dataclass(frozen=True)
class JudgeConfig:
    """``jitter``: noise on the evidence, in its standard deviations: there are few places to learn from."""

    seed: int = 11
    scenes: int = 5200
    held_out: int = 280
    epochs: int = 40
    batch: int = 128
    learning_rate: float = 3e-3
    weight_decay: float = 0.05
    jitter: float = 0.3
    hidden: int = 24


class Probabilities(nn.Module):
    """What is exported: the network followed by the softmax that its loss implies."""

    def __init__(self, network: JunctionNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, evidence: Tensor) -> Tensor:
        """``(n, features)`` evidence to ``(n, readings)`` probabilities; of two readings, ``(n,)`` of the second."""
        found = torch.softmax(self.network(evidence), dim=1)
        return found[:, 1] if found.shape[1] == 2 else found


def train(name: str, config: JudgeConfig, table: Table) -> JunctionNetwork:
    """The trained network, in evaluation mode."""
    rows, truths = table
    features = rows.shape[1]
    torch.manual_seed(config.seed)
    network = JunctionNetwork(features, len(_SUBJECTS[name][2]), config.hidden)
    network.mean = torch.from_numpy(rows.mean(axis=0))
    network.scale = torch.from_numpy(rows.std(axis=0) + 1e-3)
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.epochs)
    inputs, targets = torch.from_numpy(rows), torch.from_numpy(truths)
    spread = config.jitter * network.scale
    for epoch in range(config.epochs):
        order = np.random.default_rng([config.seed, epoch]).permutation(len(rows))
        for start in range(0, len(order), config.batch):
            chosen = order[start : start + config.batch]
            noisy = inputs[chosen] + spread * torch.randn(len(chosen), features)
            loss = nn.functional.cross_entropy(network(noisy), targets[chosen])
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
        schedule.step()
    return network.eval()


def as_judge(network: JunctionNetwork) -> Judge:
    """The network as the solver uses it."""
    module = Probabilities(network)

    def judge(rows: Float32Array) -> Float32Array:
        with torch.inference_mode():
            found: Float32Array = module(torch.from_numpy(rows)).numpy()
        return found

    return judge


def evaluate(name: str, network: JunctionNetwork, table: Table) -> dict[str, float]:
    """Share of places that are read right, in all and of each reading."""
    rows, truths = table
    with torch.inference_mode():
        right = network(torch.from_numpy(rows)).numpy().argmax(axis=1) == truths
    shares = {f"{reading}_right": right[truths == k] for k, reading in enumerate(_SUBJECTS[name][2])}
    return {k: round(float(v.mean()), 4) for k, v in {"accuracy": right, **shares}.items() if len(v)}


def export_judge(name: str, network: JunctionNetwork, config: JudgeConfig, table: Table, held_out: Table) -> None:
    features = table[0].shape[1]
    task, what, readings = _SUBJECTS[name]
    metrics = evaluate(name, network, held_out)
    card = Card(
        version="1.0",
        task=task,
        default=True,
        input=f"(n, {features}) float32: {what}",
        license="Apache-2.0",
        origin="trained from scratch on masks of random harnesses that training draws itself",
        preprocess={"evidence": features},
        training={**asdict(config), "places": dict(zip(readings, np.bincount(table[1]).tolist(), strict=True))},
        metrics=metrics,
    )
    rng = torch.Generator().manual_seed(config.seed)
    examples: list[Tensor | tuple[Tensor, ...]] = [torch.rand(n, features, generator=rng) for n in (2, 0, 1, 40)]
    dynamic = {0: torch.export.Dim("n")}
    difference = export(Probabilities(network), name, card, examples, dynamic, 1e-4, ("evidence",), ("probability",))
    print(json.dumps({"network": name, "metrics": metrics, "places": len(table[0]), "onnx_difference": difference}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=JudgeConfig.seed)
    parser.add_argument("--scenes", type=int, default=JudgeConfig.scenes)
    args = parser.parse_args()
    config = JudgeConfig(seed=args.seed, scenes=args.scenes)
    torch.set_num_threads(1)
    topology = load("topology", Runtime(threads=1))
    seen = scenes(config.seed, _FIRST, config.scenes, topology)
    held_out = scenes(config.seed, _HELD_OUT, config.held_out, topology)
    judges = Judges(_unused, _unused, _unused)
    table = stub_table(seen)
    stubs = train(STUBS, config, table)
    export_judge(STUBS, stubs, config, table, stub_table(held_out))
    judges = replace(judges, stub=as_judge(stubs))
    table = bridge_table(seen, judges)
    bridges = train(BRIDGES, config, table)
    export_judge(BRIDGES, bridges, config, table, bridge_table(held_out, judges))
    judges = replace(judges, bridge=as_judge(bridges))
    table = crossing_table(seen, judges)
    export_judge(CROSSINGS, train(CROSSINGS, config, table), config, table, crossing_table(held_out, judges))


def _unused(rows: Float32Array) -> Float32Array:
    raise AssertionError("a judge is used before it is trained")


if __name__ == "__main__":
    main()
