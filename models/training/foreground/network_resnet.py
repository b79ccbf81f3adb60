"""ResNet as an encoder (He et al. 2016) with an output stride of 16 by atrous convolutions (Chen et
al. 2018).

Parameter names are those of the widely published ImageNet weights, so that these fit.
"""

from __future__ import annotations

from torch import Tensor, nn

_EXPANSION = 4


class Bottleneck(nn.Module):
    """1 × 1, 3 × 3, 1 × 1 and a skip; the 3 × 3 convolution carries stride and dilation."""

    def __init__(self, inputs: int, width: int, stride: int, dilation: int) -> None:
        super().__init__()
        outputs = width * _EXPANSION
        self.conv1, self.bn1 = nn.Conv2d(inputs, width, 1, bias=False), nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, dilation, dilation, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3, self.bn3 = nn.Conv2d(width, outputs, 1, bias=False), nn.BatchNorm2d(outputs)
        self.relu = nn.ReLU(inplace=True)
        self.downsample: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)
            )

    def forward(self, x: Tensor) -> Tensor:
        y = self.relu(self.bn1(self.conv1(x)))
        y = self.relu(self.bn2(self.conv2(y)))
        return self.relu(self.bn3(self.conv3(y)) + self.downsample(x))


def _layer(inputs: int, width: int, blocks: int, stride: int, dilation: int = 1) -> nn.Sequential:
    """A group of blocks. The first one still sees the finer grid, so that ``dilation`` begins after
    it."""
    outputs = width * _EXPANSION
    rest = [Bottleneck(outputs, width, 1, dilation) for _ in range(blocks - 1)]
    return nn.Sequential(Bottleneck(inputs, width, stride, 1), *rest)


class ResNet(nn.Module):
    """``depths`` blocks a stage: (3, 4, 6, 3) is ResNet-50, (3, 4, 23, 3) ResNet-101; ``width`` of
    the stem."""

    stride = 16

    def __init__(self, depths: tuple[int, int, int, int], width: int = 64) -> None:
        super().__init__()
        self.channels = width * _EXPANSION, 8 * width * _EXPANSION
        self.conv1, self.bn1 = nn.Conv2d(3, width, 7, 2, 3, bias=False), nn.BatchNorm2d(width)
        self.relu, self.maxpool = nn.ReLU(inplace=True), nn.MaxPool2d(3, 2, 1)
        self.layer1 = _layer(width, width, depths[0], 1)
        self.layer2 = _layer(width * _EXPANSION, 2 * width, depths[1], 2)
        self.layer3 = _layer(2 * width * _EXPANSION, 4 * width, depths[2], 2)
        self.layer4 = _layer(4 * width * _EXPANSION, 8 * width, depths[3], 1, dilation=2)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """(B, 3, H, W) to low-level features at stride 4 and high-level ones at stride 16."""
        x = self.maxpool(self.relu(self.bn1(self.conv1(image))))
        low = self.layer1(x)
        return low, self.layer4(self.layer3(self.layer2(low)))
