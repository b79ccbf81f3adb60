"""A trained dynamics network to ONNX: ``python -m models.training.dynamics.export CHECKPOINT``.

Three files of the same weights: the next state alone, with its derivatives by the action, and with those by the
rope's parameters.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import torch
from torch import Tensor, nn

from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.simulator import BENDING, DAMPING, LENGTH_M, MASS_KG, SimulationParams
from models.training.dynamics.network_dynamics import DynamicsNetwork
from models.training.dynamics.network_tangents import DynamicsTangents
from models.training.export import Card, export

INPUTS = ("state", "edge", "move", "rope")
NODES = 16


def example(batch: int, seed: int = 0) -> tuple[Tensor, ...]:
    """Inputs of a network: state in its frame, one-hot edge, scaled move and rope."""
    rng = torch.Generator().manual_seed(seed)
    edge = nn.functional.one_hot(torch.randint(0, NODES - 1, (batch,), generator=rng), NODES - 1).float()
    return (
        0.1 * torch.randn(batch, NODES, 2, generator=rng), edge,
        2 * torch.rand(batch, 3, generator=rng) - 1, torch.rand(batch, 3, generator=rng),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m models.training.dynamics.export", description=__doc__)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--version", default="1")
    args = parser.parse_args()
    state = torch.load(args.checkpoint, weights_only=True)
    network = DynamicsNetwork()
    network.load_state_dict(state["average"])
    network.eval().requires_grad_(False)
    dim = torch.export.Dim("batch", min=1, max=4096)
    parts: dict[str, tuple[nn.Module, tuple[str, ...]]] = {
        "dynamics": (network, ("next_state",)),
        "dynamics_by_move": (DynamicsTangents(network, "move"), ("next_state", "by_move")),
        "dynamics_by_rope": (DynamicsTangents(network, "rope"), ("next_state", "by_rope")),
    }
    for name, (module, outputs) in parts.items():
        card = Card(
            version=args.version,
            task=name,
            default=True,
            input="state (B, 16, 2) m in the edge's frame, edge (B, 15) one-hot, move (B, 3) and rope (B, 3) scaled",
            license="Apache-2.0",
            origin="trained from scratch by this repository on its own simulations (models/manipulation/simulator.py)",
            preprocess={
                "nodes": NODES, "move_scale": MOVE_SCALE.tolist(), "mass_kg": list(MASS_KG),
                "bending": list(BENDING), "damping": list(DAMPING), "length_m": list(LENGTH_M),
                "duration_s": SimulationParams().duration_s,
            },
            training={
                "command": "python -m models.training.dynamics.train",
                **state["params"],
                "steps": state["steps"],
            },
            metrics=state["metrics"],
        )  # fmt: skip
        difference = export(
            module, name, card, [example(7), example(1), example(15, 1), example(120, 2)],
            [{0: dim}] * len(INPUTS), 1e-4, INPUTS, outputs,
        )  # fmt: skip
        print(json.dumps({name: difference, **state["metrics"]}))


if __name__ == "__main__":
    main()
