"""ConvNeXt as an encoder (Liu et al. 2022). Parameter names are those of the published ImageNet
weights.

Left out: stochastic depth, a regularizer for a fixed data set; ours is rendered without end.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_EPS = 1e-6


class ChannelNorm(nn.LayerNorm):
    """Layer normalization over the channels of (B, C, H, W)."""

    def forward(self, x: Tensor) -> Tensor:
        normalized = super().forward(x.permute(0, 2, 3, 1))
        return normalized.permute(0, 3, 1, 2)


class Block(nn.Module):
    """7 × 7 per channel, then a two-layer perceptron per pixel, scaled by ``gamma``, and a skip
    (figure 4)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.dwconv = nn.Conv2d(channels, channels, 7, padding=3, groups=channels)
        self.norm = nn.LayerNorm(channels, eps=_EPS)
        self.pwconv1, self.pwconv2 = (
            nn.Linear(channels, 4 * channels),
            nn.Linear(4 * channels, channels),
        )
        self.gamma = nn.Parameter(torch.full((channels,), 1e-6))

    def forward(self, x: Tensor) -> Tensor:
        y = self.norm(self.dwconv(x).permute(0, 2, 3, 1))
        y = self.gamma * self.pwconv2(F.gelu(self.pwconv1(y)))
        return x + y.permute(0, 3, 1, 2)


def _initialize(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d | nn.Linear):
        nn.init.trunc_normal_(module.weight, std=0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


class ConvNeXt(nn.Module):
    """``depths`` blocks a stage: (3, 3, 9, 3) is ConvNeXt-T, (3, 3, 27, 3) ConvNeXt-S; ``width`` of
    the stem."""

    stride = 32

    def __init__(self, depths: tuple[int, int, int, int], width: int = 96) -> None:
        super().__init__()
        widths = [width * 2**k for k in range(4)]
        self.channels = widths[0], widths[3]
        steps = [nn.Sequential(nn.Conv2d(3, width, 4, 4), ChannelNorm(width, eps=_EPS))]
        for k in range(3):
            reduce = nn.Conv2d(widths[k], widths[k + 1], 2, 2)
            steps.append(nn.Sequential(ChannelNorm(widths[k], eps=_EPS), reduce))
        self.downsample_layers = nn.ModuleList(steps)
        self.stages = nn.ModuleList(
            nn.Sequential(*(Block(w) for _ in range(n)))
            for w, n in zip(widths, depths, strict=True)
        )
        self.norm = nn.LayerNorm(widths[3], eps=_EPS)
        self.apply(_initialize)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """(B, 3, H, W) to low-level features at stride 4 and high-level ones at stride 32."""
        low = self.stages[0](self.downsample_layers[0](image))
        x = low
        for k in range(1, 4):
            x = self.stages[k](self.downsample_layers[k](x))
        return low, self.norm(x.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
