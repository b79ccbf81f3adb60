"""The two networks of Ariadne+, both on a ResNet-18 (thesis 3.3.6 and 3.3.8).

The backbone is He et al.'s 18-layer network with a width factor: 0.25 of the channels everywhere,
because the patches are small and both networks together are to stay under a few megabytes.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

WIDTH_FACTOR = 0.25
EMBEDDING = 256


class Block(nn.Module):
    """Two 3x3 convolutions around a shortcut; ``stride`` 2 halves the size."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.first_norm = nn.BatchNorm2d(outputs)
        self.second = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.second_norm = nn.BatchNorm2d(outputs)
        self.shortcut: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.shortcut = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)
            )

    def forward(self, x: Tensor) -> Tensor:
        inner = F.relu(self.first_norm(self.first(x)))
        return F.relu(self.second_norm(self.second(inner)) + self.shortcut(x))


class ResidualFeatures(nn.Module):
    """ResNet-18 up to the pooled features: ``(n, 3, h, w)`` to ``(n, features)``."""

    def __init__(self, factor: float = WIDTH_FACTOR) -> None:
        super().__init__()
        channels = [int(factor * c) for c in (64, 128, 256, 512)]
        self.features = channels[-1]
        # Patches are 32 to 64 px: the first convolution keeps 3x3 instead of 7x7 and there is one
        # stride less.
        self.stem = nn.Sequential(
            nn.Conv2d(3, channels[0], 3, 2, 1, bias=False), nn.BatchNorm2d(channels[0]), nn.ReLU()
        )
        blocks: list[nn.Module] = []
        inputs = channels[0]
        for stage, outputs in enumerate(channels):
            blocks += [Block(inputs, outputs, 1 if stage == 0 else 2), Block(outputs, outputs, 1)]
            inputs = outputs
        self.blocks = nn.Sequential(*blocks)

    def forward(self, x: Tensor) -> Tensor:
        """``(n, 3, h, w)`` RGB 0 to 1."""
        return self.blocks(self.stem(2 * x - 1)).mean((2, 3))


class TripletNet(nn.Module):
    """Patch around a node to an embedding; patches of one cable lie near each other."""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = ResidualFeatures()
        self.embed = nn.Linear(self.backbone.features, EMBEDDING)

    def forward(self, patches: Tensor) -> Tensor:
        """``(n, 3, 32, 32)`` RGB 0 to 1 to ``(n, 256)``."""
        embeddings: Tensor = self.embed(self.backbone(patches))
        return embeddings


class CrossNet(nn.Module):
    """Patch of a crossing with all but one cable blackened to a logit: is that one above?"""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = ResidualFeatures()
        self.decide = nn.Linear(self.backbone.features, 1)

    def forward(self, patches: Tensor) -> Tensor:
        """``(n, 3, 64, 64)`` RGB 0 to 1 to ``(n,)`` logits."""
        logits: Tensor = self.decide(self.backbone(patches)).squeeze(1)
        return logits


class AboveProbability(nn.Module):
    """What is exported of CrossNet: the network followed by its sigmoid."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, patches: Tensor) -> Tensor:
        """``(n, 3, 64, 64)`` to ``(n,)`` probabilities."""
        return torch.sigmoid(self.network(patches))
