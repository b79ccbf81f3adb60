"""The orientation network of RT-DLO (thesis 3.5.2)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from models.instances.published.rt_dlo.orientation import CLASSES, PATCH_SIZE


class OrientationNetwork(nn.Module):
    """Two convolutions with batch normalization, pooling between them, and one fully connected
    layer."""

    def __init__(self, channels: int = 8) -> None:
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(1, channels, 3, padding=1, bias=False),
            nn.BatchNorm2d(channels),
            nn.ReLU(),
            nn.MaxPool2d(2),
            nn.Conv2d(channels, channels, 3, bias=False),
            nn.BatchNorm2d(channels),
            nn.ReLU(),
            nn.Flatten(),
        )
        side = PATCH_SIZE // 2 - 2
        self.classes = nn.Linear(channels * side * side, CLASSES)

    def forward(self, patches: Tensor) -> Tensor:
        """``(n, s, s)`` float32 distances in radii to ``(n, 180)`` logits, one per degree in [0,
        180)."""
        logits: Tensor = self.classes(self.features(patches.unsqueeze(1)))
        return logits


class OrientationProbabilities(nn.Module):
    """What is exported: the network followed by the sigmoid that its loss implies."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, patches: Tensor) -> Tensor:
        """``(n, s, s)`` float32 to ``(n, 180)`` probabilities."""
        return torch.sigmoid(self.network(patches))
