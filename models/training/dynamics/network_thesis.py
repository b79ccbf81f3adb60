"""The dynamics network of the thesis (5.4.3, Fig. 5.4): blocks of linear layers and ReLU for state,
action and parameters; the last two weigh the state's features element by element."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn


def _layers(*sizes: int) -> nn.Sequential:
    return nn.Sequential(
        *(layer for a, b in pairwise(sizes) for layer in (nn.Linear(a, b), nn.ReLU()))
    )


class ThesisNetwork(nn.Module):
    def __init__(self, nodes: int = 16, width: int = 256, conditioned: bool = True) -> None:
        super().__init__()
        self.conditioned = conditioned
        self.action = _layers(4, width, width)
        self.parameters_block = _layers(3, width, width) if conditioned else None
        self.dlo = _layers(2 * nodes, width, width)
        self.prediction = nn.Sequential(
            _layers(width, width, width, width), nn.Linear(width, 2 * nodes)
        )

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """As DynamicsNetwork, in the principal frame."""
        index = edge @ torch.linspace(0, 1, edge.shape[1], device=edge.device)
        features = self.dlo(state.flatten(1)) * self.action(torch.cat([index[:, None], move], 1))
        if self.parameters_block is not None:
            features = features * self.parameters_block(rope)
        return state + self.prediction(features).reshape(state.shape)
