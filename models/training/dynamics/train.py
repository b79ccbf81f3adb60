"""The dynamics network (thesis 5.4), trained on simulated samples.

    python -m models.training.dynamics.data build/varied.npz --samples 300000 --actions 6 --seed 1
    python -m models.training dynamics --data build/varied.npz --minutes 17

Three files of the same weights are exported: the next state alone, with its derivatives by the
action, and with those by the rope's parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import IntArray
from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.simulator import BENDING, DAMPING, LENGTH_M, MASS_KG, SimulationParams
from models.training.dynamics.data import Samples
from models.training.dynamics.network_dynamics import DynamicsNetwork
from models.training.dynamics.network_tangents import DynamicsTangents
from models.training.dynamics.networks import NETWORKS, build, frame_of, tensors
from models.training.export import Exported
from models.training.fit import Family, Source
from models.training.state import Config

NAME = "dynamics"
INPUTS = ("state", "edge", "move", "rope")
NODES = 16
_HELD_OUT = 0.1


@dataclass(frozen=True)
class DynamicsConfig(Config):
    """``network`` by its name; ``conditioned`` on the rope's parameters. Thesis 5.7.1: 100 epochs
    at batch 128."""

    minutes: float = 30.0
    batch: int = 512
    rate: float = 1.5e-3
    warm_up: float = 0.02
    weight_decay: float = 1e-4
    clip: float = 1.0
    keep: float = 0.999
    network: str = "dynamics"
    conditioned: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.network not in NETWORKS:
            raise ValueError(f"network is {self.network!r}; there are {', '.join(NETWORKS)}")


@dataclass(frozen=True, eq=False)
class Columns:
    """State, one-hot edge, move, rope and next state ``(N, …)`` of every sample."""

    parts: tuple[Tensor, ...]

    def __len__(self) -> int:
        return len(self.parts[0])

    def taken(self, rows: IntArray) -> tuple[Tensor, ...]:
        chosen = torch.from_numpy(rows)
        return tuple(part[chosen] for part in self.parts)


def node_error(predicted: Tensor, true: Tensor) -> Tensor:
    """Mean distance a node, (B,) m."""
    return (predicted - true).norm(dim=-1).mean(1)


def centimeters(predicted: Tensor, true: Tensor) -> Tensor:
    """Mean squared error (5.4.3) in units of a centimeter, its square root taken a sample at a
    time: large motions do not outweigh small ones."""
    squared = (1e4 * (predicted - true).square()).sum(-1).mean(1)
    return (squared + 1e-4).sqrt().mean()


def split(samples: Samples) -> tuple[Samples, Samples]:
    """Training and validation. Sequences are apart by whole chunks, so the last tenth shares none
    with the rest."""
    kept = round((1 - _HELD_OUT) * len(samples))
    return samples.taken(slice(0, kept)), samples.taken(slice(kept, None))


def columns(samples: Samples, network: str) -> tuple[Columns, Columns]:
    """Training and validation, in the frame that a network sees."""
    first, last = (Columns(tensors(part, frame_of(network))) for part in split(samples))
    return first, last


def samples(config: DynamicsConfig, source: Source) -> tuple[Columns, Columns]:
    assert source.data is not None
    return columns(Samples.load(source.data), config.network)


def loss_of(
    network: nn.Module,
    data: Columns,
    rows: IntArray,
    rng: np.random.Generator,
    config: DynamicsConfig,
) -> Tensor:
    *inputs, true = data.taken(rows)
    return centimeters(network(*inputs), true)


@torch.inference_mode()
def measure(network: nn.Module, data: Columns, config: DynamicsConfig) -> dict[str, float]:
    """Mean node error, and its ratio to the mean displacement of a node;
    ``gain_share``: by how much it is below that of a network which expects no motion."""
    parts = []
    for rows in torch.arange(len(data)).split(4096):
        *inputs, true = (part[rows] for part in data.parts)
        parts.append((node_error(network(*inputs), true), node_error(inputs[0], true)))
    error, moved = (torch.cat(column) for column in zip(*parts, strict=True))
    share = float(error.mean() / moved.mean())
    return {
        "error_mm": round(1e3 * float(error.mean()), 4),
        "median_mm": round(1e3 * float(error.median()), 4),
        "error_share": round(share, 5),
        "gain_share": round(1 - share, 5),
    }


def without(data: Columns, config: DynamicsConfig) -> dict[str, Any]:
    error = torch.cat(
        [
            node_error(data.parts[0][rows], data.parts[-1][rows])
            for rows in torch.arange(len(data)).split(4096)
        ]
    )
    return {
        "rule": "no motion",
        "error_mm": round(1e3 * float(error.mean()), 4),
        "median_mm": round(1e3 * float(error.median()), 4),
        "error_share": 1.0,
    }


def example(batch: int, seed: int = 0) -> tuple[Tensor, ...]:
    """Inputs of a network: state in its frame, one-hot edge, scaled move and rope."""
    rng = torch.Generator().manual_seed(seed)
    edge = nn.functional.one_hot(
        torch.randint(0, NODES - 1, (batch,), generator=rng), NODES - 1
    ).float()
    return (
        0.1 * torch.randn(batch, NODES, 2, generator=rng),
        edge,
        2 * torch.rand(batch, 3, generator=rng) - 1,
        torch.rand(batch, 3, generator=rng),
    )


def exports(network: nn.Module, data: Columns, config: DynamicsConfig) -> list[Exported]:
    """Raises ValueError for one of the rivals: they were built to be compared, their derivatives
    are not written."""
    if not isinstance(network, DynamicsNetwork) or not config.conditioned:
        raise ValueError("only the conditioned network 'dynamics' can be exported")
    network.eval().requires_grad_(False)
    parts: dict[str, tuple[nn.Module, tuple[str, ...]]] = {
        "dynamics": (network, ("next_state",)),
        "dynamics_by_move": (DynamicsTangents(network, "move"), ("next_state", "by_move")),
        "dynamics_by_rope": (DynamicsTangents(network, "rope"), ("next_state", "by_rope")),
    }
    dim = torch.export.Dim("batch", min=1, max=4096)
    return [
        Exported(
            name,
            module,
            name,
            "state (B, 16, 2) m in the edge's frame, edge (B, 15) one-hot, move (B, 3) and rope (B, 3) scaled",
            "trained from scratch by this repository on its own simulations (models/manipulation/simulator.py)",
            {
                "nodes": NODES,
                "move_scale": MOVE_SCALE.tolist(),
                "mass_kg": list(MASS_KG),
                "bending": list(BENDING),
                "damping": list(DAMPING),
                "length_m": list(LENGTH_M),
                "duration_s": SimulationParams().duration_s,
            },
            [example(7), example(1), example(15, 1), example(120, 2)],
            [{0: dim}] * len(INPUTS),
            1e-4,
            INPUTS,
            outputs,
            version="1",
        )
        for name, (module, outputs) in parts.items()
    ]


FAMILY = Family(
    NAME,
    DynamicsConfig,
    samples,
    lambda config, data: build(config.network, config.conditioned),
    loss_of,
    measure,
    without,
    exports,
    least={"gain_share": 0.0},
    needs=("data",),
)
