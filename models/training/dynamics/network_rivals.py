"""The architectures that the thesis compares with (5.7.3), written anew at about equal size, as
nodes with features.

Every node sees its place, how the gripper moves it (zero unless it is held), how far along the DLO
the gripped edge lies, and, when conditioned, the rope's parameters.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


def node_features(state: Tensor, edge: Tensor, move: Tensor, rope: Tensor | None) -> Tensor:
    """(B, n, 7 or 10)."""
    held = nn.functional.pad(edge, (0, 1)) + nn.functional.pad(edge, (1, 0))
    places = torch.linspace(-1, 1, state.shape[1], device=state.device)
    away = places[None] - (edge @ (places[:-1] + places[1:]))[:, None] / 2
    parts = [4 * state, held[..., None], held[..., None] * move[:, None], away[..., None]]
    if rope is not None:
        parts.append(rope[:, None].expand(-1, state.shape[1], -1))
    return torch.cat(parts, -1)


class BiLSTM(nn.Module):
    """A bidirectional LSTM along the nodes."""

    def __init__(self, nodes: int = 16, width: int = 144, conditioned: bool = True) -> None:
        super().__init__()
        self.conditioned = conditioned
        self.lstm = nn.LSTM(
            10 if conditioned else 7, width, 2, batch_first=True, bidirectional=True
        )
        self.leave = nn.Linear(2 * width, 2)

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """As DynamicsNetwork, in the principal frame."""
        features = node_features(state, edge, move, rope if self.conditioned else None)
        return state + 0.1 * self.leave(self.lstm(features)[0])


class InteractionLayer(nn.Module):
    """Messages over the edges in both directions, then nodes take them in, with a skip."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.relation = nn.Sequential(
            nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, width)
        )
        self.update = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, width))

    def forward(self, x: Tensor) -> Tensor:
        left, right = x[:, :-1], x[:, 1:]
        to_right, to_left = (
            self.relation(torch.cat([left, right], -1)),
            self.relation(torch.cat([right, left], -1)),
        )
        received = nn.functional.pad(to_right, (0, 0, 1, 0)) + nn.functional.pad(
            to_left, (0, 0, 0, 1)
        )
        return x + self.update(torch.cat([x, received], -1))


class INBiLSTM(nn.Module):
    """An interaction layer between neighbors before the bidirectional LSTM."""

    def __init__(self, nodes: int = 16, width: int = 128, conditioned: bool = True) -> None:
        super().__init__()
        self.conditioned = conditioned
        self.enter = nn.Linear(10 if conditioned else 7, width)
        self.interaction = InteractionLayer(width)
        self.lstm = nn.LSTM(width, width, 1, batch_first=True, bidirectional=True)
        self.leave = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, 2))

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """As DynamicsNetwork, in the principal frame."""
        features = node_features(state, edge, move, rope if self.conditioned else None)
        return state + 0.1 * self.leave(self.lstm(self.interaction(self.enter(features)))[0])


class GNN(nn.Module):
    """Several interaction layers along the chain: the gripper's motion has to travel node by
    node."""

    def __init__(
        self, nodes: int = 16, width: int = 96, layers: int = 8, conditioned: bool = True
    ) -> None:
        super().__init__()
        self.conditioned = conditioned
        self.enter = nn.Linear(10 if conditioned else 7, width)
        self.layers = nn.Sequential(*(InteractionLayer(width) for _ in range(layers)))
        self.leave = nn.Linear(width, 2)

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """As DynamicsNetwork, in the principal frame."""
        features = node_features(state, edge, move, rope if self.conditioned else None)
        return state + 0.1 * self.leave(self.layers(self.enter(features)))


class RBF(nn.Module):
    """Gaussian radial basis functions of state, action and parameters, and one linear layer."""

    def __init__(self, nodes: int = 16, width: int = 7000, conditioned: bool = True) -> None:
        super().__init__()
        self.conditioned = conditioned
        inputs = 2 * nodes + 4 + (3 if conditioned else 0)
        self.centers = nn.Parameter(torch.randn(width, inputs) * 0.6)
        self.log_width = nn.Parameter(torch.full((width,), 1.5))
        self.leave = nn.Linear(width, 2 * nodes)

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """As DynamicsNetwork, in the principal frame."""
        index = edge @ torch.linspace(-1, 1, edge.shape[1], device=edge.device)
        parts = [
            4 * state.flatten(1),
            index[:, None],
            move,
            *([2 * rope - 1] if self.conditioned else []),
        ]
        x = torch.cat(parts, 1)
        squared = (
            x.square().sum(1, keepdim=True) - 2 * x @ self.centers.T + self.centers.square().sum(1)
        )
        basis = torch.exp(-squared / (2 * torch.exp(2 * self.log_width)))
        return state + self.leave(basis).reshape(state.shape)
