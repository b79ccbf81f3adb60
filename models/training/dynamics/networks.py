"""The dynamics networks by name, and samples as their inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from models.manipulation.frames import FrameKind, frames
from models.manipulation.scaling import scale_move, scale_rope
from models.training.dynamics.data import Samples
from models.training.dynamics.network_dynamics import DynamicsNetwork
from models.training.dynamics.network_rivals import GNN, RBF, BiLSTM, INBiLSTM
from models.training.dynamics.network_thesis import ThesisNetwork

NETWORKS: Mapping[str, type[nn.Module]] = {
    "dynamics": DynamicsNetwork,
    "thesis": ThesisNetwork,
    "bilstm": BiLSTM,
    "inbilstm": INBiLSTM,
    "gnn": GNN,
    "rbf": RBF,
}


def build(name: str, conditioned: bool = True) -> nn.Module:
    """A new network with random weights. Raises ValueError for an unknown name."""
    if name not in NETWORKS:
        raise ValueError(f"unknown network {name!r}; there are {', '.join(NETWORKS)}")
    return NETWORKS[name](conditioned=conditioned)


def frame_of(name: str) -> FrameKind:
    """The kind of frame that a network sees."""
    return "edge" if name == "dynamics" else "principal"


def tensors(samples: Samples, kind: FrameKind) -> tuple[Tensor, ...]:
    """State, one-hot edge, move, rope and next state of every sample, in the ``kind`` of frame."""
    before, nodes = samples.before.astype(np.float64), samples.before.shape[1]
    placed = frames(kind, before, samples.edge)
    edge = np.eye(nodes - 1)[placed.edges_to_frame(samples.edge, nodes)]
    move = samples.move.astype(np.float64)
    move = np.column_stack([placed.vectors_to_frame(move[:, :2]), move[:, 2]])
    columns = (
        placed.to_frame(before),
        edge,
        scale_move(move),
        scale_rope(samples.rope[:, :3].astype(np.float64)),
        placed.to_frame(samples.after.astype(np.float64)),
    )
    return tuple(torch.from_numpy(c.astype(np.float32)) for c in columns)
