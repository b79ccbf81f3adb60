"""The similarity network of FASTDLO (thesis 3.4.4, Fig. 3.10)."""

from __future__ import annotations

from torch import Tensor, nn

from models.instances.published.fastdlo.similarity import FEATURES

EMBEDDING = 16


class SimilarityNetwork(nn.Module):
    """Three fully connected layers."""

    def __init__(self, hidden: int = 48) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(FEATURES, hidden),
            nn.ReLU(),
            nn.Linear(hidden, hidden),
            nn.ReLU(),
            nn.Linear(hidden, EMBEDDING),
        )

    def forward(self, features: Tensor) -> Tensor:
        """``(n, 7)`` float32 endpoint features to ``(n, 16)`` embeddings."""
        embeddings: Tensor = self.layers(features)
        return embeddings
