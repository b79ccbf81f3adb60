"""The shipped dynamics network: a residual perceptron in the frame of the gripped edge.

Past thesis 5.4.3 in three ways: the frame (see ``frames``), the two gripped nodes are placed
exactly, and the parameters enter together with the ratio k_b / k_d, which is what a slow motion
depends on.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

SCALE_M = 0.25
"""States are divided by this."""


class Block(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.inner, self.outer = nn.Linear(width, width), nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        return x + self.outer(nn.functional.silu(self.inner(self.norm(x))))


class DynamicsNetwork(nn.Module):
    """``nodes`` n of a state; ``conditioned`` False leaves the rope's parameters out (thesis
    5.7.3)."""

    def __init__(
        self, nodes: int = 16, width: int = 320, blocks: int = 3, conditioned: bool = True
    ) -> None:
        super().__init__()
        self.nodes, self.conditioned = nodes, conditioned
        inputs = 2 * nodes + (nodes - 1) + 4 + (4 if conditioned else 0)
        self.enter = nn.Linear(inputs, width)
        self.blocks = nn.Sequential(*(Block(width) for _ in range(blocks)))
        last = nn.Linear(width, 2 * nodes)
        nn.init.zeros_(last.weight)
        self.leave = nn.Sequential(nn.LayerNorm(width), last)

    def forward(self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor) -> Tensor:
        """``state`` (B, n, 2) m in the edge frame, ``edge`` (B, n - 1) one-hot, ``move`` (B, 3)
        scaled to -1 … 1, ``rope`` (B, 3) mass, k_b, k_d scaled to 0 … 1; the next state (B, n, 2) m
        in the same frame."""
        angle = move[:, 2:] * (torch.pi / 4)
        cos, sin = torch.cos(angle), torch.sin(angle)
        parts = [state.flatten(1) / SCALE_M, edge, move[:, :2], sin, cos - 1]
        if self.conditioned:
            bending, damping = 0.05 + 0.95 * rope[:, 1:2], 3.0 + 27.0 * rope[:, 2:3]
            parts += [rope, 0.5 * torch.log(20 * bending / damping)]
        features = self.blocks(self.enter(torch.cat(parts, 1)))
        free = state + SCALE_M * self.leave(features).reshape(state.shape)
        near, far = nn.functional.pad(edge, (0, 1)), nn.functional.pad(edge, (1, 0))
        held = (near + far)[:, :, None]
        turned = torch.stack(
            [cos * state[..., 0] - sin * state[..., 1], sin * state[..., 0] + cos * state[..., 1]],
            -1,
        )
        return torch.where(held > 0.5, turned + 0.1 * move[:, None, :2], free)
