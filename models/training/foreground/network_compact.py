"""A small foreground network for processors: MobileNetV2 encoder, feature pyramid, sub-pixel head.

Encoder: Sandler et al. 2018 (inverted residuals), the stages up to stride 32, so that its published
ImageNet weights fit. Decoder: a 48-channel top-down pyramid to stride 4, then a pixel shuffle to
full size. A level at stride 2 took two fifths of the time; the same time spent on a picture half as
large again finds more.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
import torch.nn.functional as F
from torch import Tensor, nn

# expansion, channels, repeats, stride of each group of inverted residuals
_GROUPS = (
    (1, 16, 1, 1),
    (6, 24, 2, 2),
    (6, 32, 3, 2),
    (6, 64, 4, 2),
    (6, 96, 3, 1),
    (6, 160, 3, 2),
    (6, 320, 1, 1),
)
_TAPS = {3: 24, 6: 32, 13: 96, 17: 320}  # block index: channels, at strides 4, 8, 16, 32
_FINEST = 4  # stride of the first of them


class _StridedDepthwise(nn.Conv2d):
    """A strided depthwise convolution that computes in single precision under autocast: its
    bfloat16 gradient takes five times as long on processors, a third of a training step of this
    network."""

    def forward(self, x: Tensor) -> Tensor:
        with torch.autocast(x.device.type, enabled=False):
            return super().forward(x.float()).to(x.dtype)


def _conv(
    inputs: int, outputs: int, size: int, stride: int = 1, groups: int = 1, relu: bool = True
) -> list[nn.Module]:
    kind = _StridedDepthwise if groups > 1 and stride > 1 else nn.Conv2d
    layers: list[nn.Module] = [
        kind(inputs, outputs, size, stride, size // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs),
    ]
    return [*layers, nn.ReLU6(inplace=True)] if relu else layers


class InvertedResidual(nn.Module):
    """Expand, filter per channel, project; the layer order is that of the published weights."""

    def __init__(self, inputs: int, outputs: int, stride: int, expansion: int) -> None:
        super().__init__()
        hidden = inputs * expansion
        widen = _conv(inputs, hidden, 1) if expansion != 1 else []
        filtered = _conv(hidden, hidden, 3, stride, hidden)
        self.conv = nn.Sequential(*widen, *filtered, *_conv(hidden, outputs, 1, relu=False))
        self.skip = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.conv(x)
        return x + y if self.skip else y


class CompactNetwork(nn.Module):
    """Foreground logits of a picture; 1.9 M parameters."""

    def __init__(self, channels: int = 48) -> None:
        super().__init__()
        blocks: list[nn.Module] = [nn.Sequential(*_conv(3, 32, 3, 2))]
        inputs = 32
        for expansion, outputs, repeats, stride in _GROUPS:
            for k in range(repeats):
                blocks.append(InvertedResidual(inputs, outputs, stride if k == 0 else 1, expansion))
                inputs = outputs
        self.features = nn.ModuleList(blocks)
        self.lateral = nn.ModuleList(nn.Conv2d(c, channels, 1) for c in _TAPS.values())
        self.smooth = nn.ModuleList(
            nn.Sequential(
                *_conv(channels, channels, 3, groups=channels), *_conv(channels, channels, 1)
            )
            for _ in range(len(_TAPS) - 1)
        )
        cells = nn.Conv2d(32, _FINEST**2, 3, padding=1)
        self.head = nn.Sequential(*_conv(channels, 32, 3), cells, nn.PixelShuffle(_FINEST))

    def forward(self, image: Tensor) -> Tensor:
        """``image`` (B, 3, H, W) normalized, H and W multiples of 32, to logits (B, 1, H, W)."""
        return self.decoded(self.encoded(image))

    def encoded(self, image: Tensor) -> list[Tensor]:
        """What the encoder sees at strides 4, 8, 16 and 32."""
        taps = []
        x = image
        for k, block in enumerate(self.features):
            x = block(x)
            if k in _TAPS:
                taps.append(x)
        return taps

    def decoded(self, taps: list[Tensor]) -> Tensor:
        """Logits (B, 1, H, W) of what the encoder saw."""
        top = self.lateral[-1](taps[-1])
        for lateral, smooth, tap in zip(
            self.lateral[-2::-1], self.smooth, taps[-2::-1], strict=True
        ):
            up = F.interpolate(top, scale_factor=2.0, mode="bilinear", align_corners=False)
            top = smooth(up + lateral(tap))
        logits: Tensor = self.head(top)
        return logits

    def load_encoder(self, weights: Mapping[str, Tensor]) -> int:
        """Take the encoder from published MobileNetV2 weights (keys ``features.N…``); returns
        tensors taken."""
        own = self.state_dict()
        taken = {k: v for k, v in weights.items() if k in own and own[k].shape == v.shape}
        self.load_state_dict(taken, strict=False)
        return len(taken)
