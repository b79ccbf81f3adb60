"""DeepLabV3+ (Chen et al. 2018; thesis 2.7.1): encoder, context at several rates, decoder with
low-level features."""

from __future__ import annotations

from collections.abc import Mapping

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from models.training.foreground.network_convnext import ConvNeXt
from models.training.foreground.network_resnet import ResNet
from models.training.foreground.network_swin import Swin

Encoder = ResNet | Swin | ConvNeXt

_RATES_AT_16 = (6, 12, 18)
_LOW_STRIDE = 4


def _conv(
    inputs: int, outputs: int, size: int = 1, rate: int = 1, groups: int = 1
) -> list[nn.Module]:
    padding = rate * (size // 2)
    return [
        nn.Conv2d(inputs, outputs, size, padding=padding, dilation=rate, groups=groups, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    ]


def _separable(inputs: int, outputs: int, rate: int = 1) -> nn.Sequential:
    """3 × 3 per channel (atrous with ``rate``), then 1 × 1."""
    return nn.Sequential(*_conv(inputs, inputs, 3, rate, groups=inputs), *_conv(inputs, outputs))


class AtrousPyramid(nn.Module):
    """ASPP: 1 × 1, three atrous rates and the whole picture's mean, side by side, then 1 × 1."""

    def __init__(self, inputs: int, outputs: int, rates: tuple[int, ...]) -> None:
        super().__init__()
        self.point = nn.Sequential(*_conv(inputs, outputs))
        self.atrous = nn.ModuleList(_separable(inputs, outputs, rate) for rate in rates)
        self.picture = nn.Sequential(*_conv(inputs, outputs))
        self.project = nn.Sequential(*_conv((2 + len(rates)) * outputs, outputs))

    def forward(self, x: Tensor) -> Tensor:
        mean = self.picture(x.mean((2, 3), keepdim=True)).expand(-1, -1, *x.shape[2:])
        return self.project(
            torch.cat([self.point(x), *(branch(x) for branch in self.atrous), mean], 1)
        )


class DeepLab(nn.Module):
    """Foreground logits of a picture. ``features`` is the encoder; ``channels`` of pyramid and
    decoder, ``low_channels`` of the low-level features beside them."""

    def __init__(self, features: Encoder, channels: int = 256, low_channels: int = 48) -> None:
        super().__init__()
        low, high = features.channels
        self.features = features
        # The rates are lengths in the picture: half as many cells of a grid that is twice as
        # coarse.
        self.context = AtrousPyramid(
            high, channels, tuple(rate * 16 // features.stride for rate in _RATES_AT_16)
        )
        self.low = nn.Sequential(*_conv(low, low_channels))
        self.refine = nn.Sequential(
            _separable(channels + low_channels, channels), _separable(channels, channels)
        )
        self.head = nn.Conv2d(channels, 1, 1)

    def forward(self, image: Tensor) -> Tensor:
        """``image`` (B, 3, H, W) normalized, H and W multiples of 32, to logits (B, 1, H, W)."""
        return self.decoded(*self.features(image))

    def decoded(self, low: Tensor, high: Tensor) -> Tensor:
        """Logits (B, 1, H, W) of what the encoder saw: low-level features at stride 4, high-level
        ones."""
        up = _enlarge(self.context(high), self.features.stride // _LOW_STRIDE)
        logits = self.head(self.refine(torch.cat([up, self.low(low)], 1)))
        return _enlarge(logits, _LOW_STRIDE)

    def load_encoder(self, weights: Mapping[str, Tensor]) -> int:
        """Take the encoder from its published ImageNet weights; returns tensors taken."""
        own = self.features.state_dict()
        taken = {k: v for k, v in weights.items() if k in own and own[k].shape == v.shape}
        self.features.load_state_dict(taken, strict=False)
        return len(taken)


def _enlarge(x: Tensor, factor: int) -> Tensor:
    return F.interpolate(x, scale_factor=float(factor), mode="bilinear", align_corners=False)
