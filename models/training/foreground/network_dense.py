"""The foreground network of ordinary 3 × 3 convolutions (ours): residual encoder, feature pyramid,
global context.

Dense convolutions fill the matrix units of current processors: at equal time they see three to four
times the pictures that depthwise ones do in training, and run as fast afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch.nn.functional as F
from torch import Tensor, nn


class Plan(NamedTuple):
    """``channels`` at 1/2, 1/4, 1/8, 1/16, 1/32 of the picture; ``blocks`` at the last four; of the
    ``pyramid``."""

    channels: tuple[int, int, int, int, int]
    blocks: tuple[int, int, int, int]
    pyramid: int

    def divided(self, slim: int) -> Plan:
        """All channels over ``slim``, for tests and slow machines."""
        half, *others = (c // slim for c in self.channels)
        return Plan((half, *others), self.blocks, self.pyramid // slim)  # type: ignore[arg-type]


PLANS: Mapping[str, Plan] = {
    "dense": Plan((16, 32, 64, 128, 192), (2, 2, 3, 2), 48),
    "dense_large": Plan((32, 64, 128, 224, 320), (2, 3, 4, 3), 96),
}
"""The student, and the teacher that labels what nobody could mark."""


def _conv(
    inputs: int, outputs: int, kernel: int = 3, stride: int = 1, relu: bool = True
) -> list[nn.Module]:
    layers: list[nn.Module] = [
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
    ]
    return [*layers, nn.ReLU(inplace=True)] if relu else layers


class Residual(nn.Module):
    """Two 3 × 3 convolutions beside the identity."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Sequential(
            *_conv(channels, channels), *_conv(channels, channels, relu=False)
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(x + self.conv(x))


class DenseNetwork(nn.Module):
    """Foreground logits of a picture, 2.8 M parameters as ``dense``."""

    def __init__(self, plan: Plan) -> None:
        super().__init__()
        half, *channels = plan.channels
        self.features = nn.ModuleList(
            [nn.Sequential(*_conv(3, half, stride=2), *_conv(half, half))]
        )
        inputs = half
        for outputs, count in zip(channels, plan.blocks, strict=True):
            blocks = [Residual(outputs) for _ in range(count)]
            self.features.append(nn.Sequential(*_conv(inputs, outputs, stride=2), *blocks))
            inputs = outputs
        width = plan.pyramid
        self.context = nn.Sequential(nn.AdaptiveAvgPool2d(1), nn.Conv2d(inputs, width, 1))
        self.lateral = nn.ModuleList(nn.Conv2d(c, width, 1) for c in channels)
        self.smooth = nn.ModuleList(nn.Sequential(*_conv(width, width)) for _ in channels[:-1])
        self.narrow = nn.Conv2d(width, half, 1)
        self.fine = nn.Sequential(*_conv(half, half))
        self.head = nn.Sequential(nn.Conv2d(half, 4, 3, padding=1), nn.PixelShuffle(2))

    def forward(self, image: Tensor) -> Tensor:
        """``image`` (B, 3, H, W) normalized, H and W multiples of 32, to logits (B, 1, H, W)."""
        taps = []
        x = image
        for stage in self.features:
            x = stage(x)
            taps.append(x)
        top = self.lateral[-1](x) + self.context(x)
        for lateral, smooth, tap in zip(
            self.lateral[-2::-1], self.smooth, taps[-2:0:-1], strict=True
        ):
            top = smooth(_doubled(top) + lateral(tap))
        logits: Tensor = self.head(self.fine(F.relu(_doubled(self.narrow(top)) + taps[0])))
        return logits

    def load_encoder(self, weights: Mapping[str, Tensor]) -> int:
        """Nobody publishes weights of this encoder. Raises ValueError."""
        raise ValueError(
            "the dense networks begin from random weights or from an export, not from published weights"
        )


def _doubled(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
