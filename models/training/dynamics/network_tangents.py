"""The dynamics network together with its derivatives, as one graph that exports: the service needs
no torch.

Strategy: forward mode by hand. K tangents travel through the layers beside the value, (B, K, width)
next to (B, width): two or three inputs and 2n outputs, so this is cheaper than 2n backward passes.
(``torch.func.jvp`` does the same but cannot be traced to a graph with a free batch size.)
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor, nn

from models.training.dynamics.network_dynamics import SCALE_M, Block, DynamicsNetwork

Variables = Literal["move", "rope"]


def _linear(layer: nn.Linear, x: Tensor, dx: Tensor) -> tuple[Tensor, Tensor]:
    return layer(x), dx @ layer.weight.T


def _silu(x: Tensor, dx: Tensor) -> tuple[Tensor, Tensor]:
    gate = torch.sigmoid(x)
    return x * gate, dx * (gate * (1 + x * (1 - gate)))[:, None]


def _norm(layer: nn.LayerNorm, x: Tensor, dx: Tensor) -> tuple[Tensor, Tensor]:
    centered = x - x.mean(1, keepdim=True)
    inverse = torch.rsqrt(centered.square().mean(1, keepdim=True) + layer.eps)
    unit = centered * inverse
    centered_dx = dx - dx.mean(2, keepdim=True)
    along = (dx * unit[:, None]).mean(2, keepdim=True)
    d_unit = (centered_dx - unit[:, None] * along) * inverse[:, None]
    return unit * layer.weight + layer.bias, d_unit * layer.weight


class DynamicsTangents(nn.Module):
    """Derivatives with respect to the scaled ``move`` (K = 3), or to the scaled k_b and k_d of
    ``rope`` (K = 2)."""

    def __init__(self, network: DynamicsNetwork, variables: Variables) -> None:
        super().__init__()
        self.network, self.variables = network, variables

    def forward(
        self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor
    ) -> tuple[Tensor, Tensor]:
        """As DynamicsNetwork, and the derivatives of the next state (B, n, 2, K)."""
        features, tangents = self._features(state, edge, move, rope)
        x, dx = _linear(self.network.enter, features, tangents)
        for block in self.network.blocks:
            assert isinstance(block, Block)
            y, dy = _norm(block.norm, x, dx)
            y, dy = _linear(block.outer, *_silu(*_linear(block.inner, y, dy)))
            x, dx = x + y, dx + dy
        last, leave = self.network.leave[0], self.network.leave[1]
        assert isinstance(last, nn.LayerNorm)
        assert isinstance(leave, nn.Linear)
        y, dy = _linear(leave, *_norm(last, x, dx))
        free = state + SCALE_M * y.reshape(state.shape)
        d_free = SCALE_M * dy.reshape(state.shape[0], dy.shape[1], state.shape[1], 2)
        return self._held(state, edge, move, free, d_free)

    def _features(
        self, state: Tensor, edge: Tensor, move: Tensor, rope: Tensor
    ) -> tuple[Tensor, Tensor]:
        quarter = torch.pi / 4
        cos, sin = torch.cos(quarter * move[:, 2:]), torch.sin(quarter * move[:, 2:])
        bending, damping = 0.05 + 0.95 * rope[:, 1:2], 3.0 + 27.0 * rope[:, 2:3]
        parts = [state.flatten(1) / SCALE_M, edge, move[:, :2], sin, cos - 1, rope]
        features = torch.cat([*parts, 0.5 * torch.log(20 * bending / damping)], 1)
        nothing = torch.zeros_like(torch.cat([parts[0], edge], 1))
        none, one = torch.zeros_like(sin), torch.ones_like(sin)
        if self.variables == "move":
            rows = [
                [one, none, none, none, none, none, none, none],
                [none, one, none, none, none, none, none, none],
                [none, none, quarter * cos, -quarter * sin, none, none, none, none],
            ]
        else:
            rows = [
                [none, none, none, none, none, one, none, 0.5 * 0.95 / bending],
                [none, none, none, none, none, none, one, -0.5 * 27.0 / damping],
            ]
        return features, torch.stack([torch.cat([nothing, *row], 1) for row in rows], 1)

    def _held(
        self, state: Tensor, edge: Tensor, move: Tensor, free: Tensor, d_free: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The two gripped nodes go where the gripper takes them."""
        quarter = torch.pi / 4
        cos, sin = torch.cos(quarter * move[:, 2:]), torch.sin(quarter * move[:, 2:])
        x, y = state[..., 0], state[..., 1]
        turned = torch.stack([cos * x - sin * y, sin * x + cos * y], -1)
        held = ((nn.functional.pad(edge, (0, 1)) + nn.functional.pad(edge, (1, 0))) > 0.5)[
            :, :, None
        ]
        value = torch.where(held, turned + 0.1 * move[:, None, :2], free)
        if self.variables == "rope":
            d_held = torch.zeros_like(d_free)
        else:
            sideways = quarter * torch.stack([-sin * x - cos * y, cos * x - sin * y], -1)
            shift = torch.zeros_like(state)
            right, down = (
                shift + 0.1 * shift.new_tensor([1.0, 0.0]),
                shift + 0.1 * shift.new_tensor([0.0, 1.0]),
            )
            d_held = torch.stack([right, down, sideways], 1)
        return value, torch.where(held[:, None], d_held, d_free).permute(0, 2, 3, 1)
