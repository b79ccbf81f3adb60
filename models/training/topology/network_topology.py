"""The networks of thesis 6.5: links, node orientation, node classification; message passing in
plain torch.

Symbols: N nodes, E undirected edges, h hidden features (32). Shapes of inputs as in
``encodings.Encoded``.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from models.topology.encodings import EDGE_FEATURES, NODE_FEATURES, PATCH

CLASSES = 180


class MessageLayer(nn.Module):
    """One layer of thesis 6.5.3: ``x_i' = relu(sum_u (W x_u + B x_i + K f_ui) + S x_i)``, u the
    neighbors of i."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.neighbor = nn.Linear(hidden, hidden, bias=False)
        self.own = nn.Linear(hidden, hidden, bias=False)
        self.edge = nn.Linear(hidden, hidden)
        self.skip = nn.Linear(hidden, hidden)

    def forward(self, nodes: Tensor, edges: Tensor, edge_features: Tensor) -> Tensor:
        """``(N, h)``, ``(2, E)``, ``(E, h)`` to ``(N, h)``; every edge carries a message each
        way."""
        both = torch.cat((edges, edges.flip(0)), dim=1)
        neighbors, own = self.neighbor(nodes), self.own(nodes)
        messages = neighbors[both[0]] + own[both[1]] + torch.cat((self.edge(edge_features),) * 2)
        summed = torch.zeros_like(nodes).index_add(0, both[1], messages)
        out: Tensor = torch.relu(summed + self.skip(nodes))
        return out


class MaskEncoder(nn.Module):
    """Two 5x5 convolutions over each node's window of the distance transform (6.5.2), ``(N, 16,
    16)`` to ``(N, h)``."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv2d(1, hidden // 2, 5, stride=2),
            nn.BatchNorm2d(hidden // 2),
            nn.ReLU(),
            nn.Conv2d(hidden // 2, hidden, 5, stride=1),
            nn.BatchNorm2d(hidden),
            nn.ReLU(),
        )
        side = (PATCH - 5) // 2 + 1 - 4
        self.out = nn.Linear(hidden * side * side, hidden)

    def forward(self, patches: Tensor) -> Tensor:
        features: Tensor = torch.relu(self.out(self.convolutions(patches.unsqueeze(1)).flatten(1)))
        return features


class TopologyNetwork(nn.Module):
    """Everything that is learned of a graph. The classifier sees the predictor's features but does
    not train them: the thesis trains it afterwards with the predictor frozen (6.5.6), which one run
    does as well."""

    def __init__(self, hidden: int = 32) -> None:
        super().__init__()
        self.mask = MaskEncoder(hidden)
        self.node_in = nn.Linear(hidden + NODE_FEATURES, hidden)
        self.edge_in = nn.Sequential(
            nn.Linear(EDGE_FEATURES, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU()
        )
        self.layers = nn.ModuleList(MessageLayer(hidden) for _ in range(3))
        self.norms = nn.ModuleList(nn.BatchNorm1d(hidden) for _ in range(2))
        # The decoder sees the edge too, beside the product of its ends: coverage of the mask tells
        # most.
        self.decoder = nn.Sequential(
            nn.Linear(2 * hidden, hidden),
            nn.ReLU(),
            nn.Linear(hidden, hidden),
            nn.ReLU(),
            nn.Linear(hidden, 1),
        )
        self.orientation = nn.Linear(hidden, CLASSES)
        self.class_in = nn.Linear(2 * hidden, hidden)
        self.class_edge = nn.Sequential(nn.Linear(1, hidden), nn.ReLU())
        self.class_layer = MessageLayer(hidden)
        self.class_out = nn.Sequential(
            nn.Linear(2 * hidden, hidden // 2), nn.ReLU(), nn.Linear(hidden // 2, 2)
        )

    def forward(
        self, patches: Tensor, nodes: Tensor, edges: Tensor, edge_features: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Logits: links ``(E,)``, orientations ``(N, 180)``, classes ``(N, 2)`` (branch-point,
        crossing)."""
        seen = self.mask(patches)
        first = torch.relu(self.node_in(torch.cat((seen, nodes), dim=1)))
        along = self.edge_in(edge_features)
        latent = self.layers[0](first, edges, along)
        latent = self.layers[1](self.norms[0](latent), edges, along)
        latent = self.layers[2](self.norms[1](latent), edges, along)
        links = self.decoder(torch.cat((latent[edges[0]] * latent[edges[1]], along), dim=1))[:, 0]
        classes = self._classify(
            first.detach(), latent.detach(), edges, along.detach(), links.detach()
        )
        return links, self.orientation(seen), classes

    def _classify(
        self, first: Tensor, latent: Tensor, edges: Tensor, along: Tensor, links: Tensor
    ) -> Tensor:
        """Subgraph classification (6.5.5): a layer over each node's star of neighbors, weighted by
        the predicted links, then pooled with the node's own features."""
        weights = torch.sigmoid(links)[:, None]
        nodes = torch.relu(self.class_in(torch.cat((first, latent), dim=1)))
        inner = self.class_layer(nodes, edges, along + self.class_edge(weights))
        both = torch.cat((edges, edges.flip(0)), dim=1)
        pooled = torch.zeros_like(inner).index_add(
            0, both[1], inner[both[0]] * torch.cat((weights, weights))
        )
        out: Tensor = self.class_out(torch.cat((inner, pooled), dim=1))
        return out


class TopologyProbabilities(nn.Module):
    """What is exported: the network followed by the sigmoid that its losses imply."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(
        self, patches: Tensor, nodes: Tensor, edges: Tensor, edge_features: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        links, orientations, classes = self.network(patches, nodes, edges, edge_features)
        return torch.sigmoid(links), torch.sigmoid(orientations), torch.sigmoid(classes)


class JunctionNetwork(nn.Module):
    """Evidence ``(n, features)`` to logits of its readings ``(n, readings)``."""

    mean: Tensor
    scale: Tensor

    def __init__(self, features: int, readings: int, hidden: int = 24) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.layers = nn.Sequential(
            nn.Linear(features, hidden),
            nn.ReLU(),
            nn.Linear(hidden, hidden),
            nn.ReLU(),
            nn.Linear(hidden, readings),
        )

    def forward(self, evidence: Tensor) -> Tensor:
        logits: Tensor = self.layers((evidence - self.mean) / self.scale)
        return logits
