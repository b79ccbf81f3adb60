"""The networks of thesis 6.5, trained on random harnesses that are drawn for them: 20 minutes on
one core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import BoolArray, IntArray
from models.instances.published.rt_dlo.orientation import principal_angles
from models.synthesis.harness import HarnessParams
from models.synthesis.harness_masks import MaskParams
from models.topology.encodings import EDGE_FEATURES, NODE_FEATURES, PATCH, Encoded
from models.training.export import Exported
from models.training.fit import Family, Source
from models.training.state import Config, kept
from models.training.topology.graphs import Sample, encode_angles, make_sample
from models.training.topology.network_topology import TopologyNetwork, TopologyProbabilities

NAME = "topology"
SIZES = ((480, 640), (360, 640), (504, 896))
Samples = list[Sample]


@dataclass(frozen=True)
class TopologyConfig(Config):
    """Thesis 6.8.1: about 1600 graphs for training, here twice as many; 280 held out, h = 32.
    Batches of 8 with a falling rate take the place of its 200 000 steps of 2 at 1e-3."""

    seed: int = 11
    batch: int = 8
    rate: float = 3e-3
    weight_decay: float = 0.0
    clip: float = 5.0
    scenes: int = 3200
    held_out: int = 280
    hidden: int = 32


@dataclass(frozen=True)
class Batch:
    """Several graphs as one, with its targets."""

    inputs: tuple[Tensor, Tensor, Tensor, Tensor]
    links: Tensor
    on: Tensor
    angles: Tensor
    classes: Tensor


def make_samples(seed: int, first: int, count: int) -> list[Sample]:
    """Scenes ``first`` to ``first + count`` of a seed; picture sizes take turns."""
    samples = []
    for k in range(first, first + count):
        params = HarnessParams(size=SIZES[k % len(SIZES)])
        samples.append(make_sample(np.random.default_rng([seed, k]), params, MaskParams()))
    return samples


def collate(samples: Sequence[Sample]) -> Batch:
    """Several samples as one graph without edges between them."""
    offsets = np.cumsum([0, *(len(s.encoded.nodes) for s in samples[:-1])])
    encoded = [s.encoded for s in samples]
    edges = np.concatenate([e.edges + o for e, o in zip(encoded, offsets, strict=True)], axis=1)
    return Batch(
        (
            _tensor(encoded, "patches"),
            _tensor(encoded, "nodes"),
            torch.from_numpy(edges),
            _tensor(encoded, "edge_features"),
        ),
        torch.from_numpy(np.concatenate([s.truth.links for s in samples]).astype(np.float32)),
        torch.from_numpy(np.concatenate([s.truth.on for s in samples])),
        torch.from_numpy(encode_angles(np.concatenate([s.truth.angles for s in samples]))),
        torch.from_numpy(np.concatenate([s.truth.classes for s in samples]).astype(np.float32)),
    )


def _tensor(encoded: list[Encoded], name: str) -> Tensor:
    return torch.from_numpy(np.concatenate([getattr(e, name) for e in encoded]))


def samples(config: TopologyConfig, source: Source) -> tuple[Samples, Samples]:
    """Scenes are drawn once and kept."""
    file = source.folder / f"scenes-{config.seed}-{config.scenes}.pickle"
    scenes = kept(file, lambda: make_samples(config.seed, 0, config.scenes))
    return scenes, make_samples(config.seed, 10**6, config.held_out)


def loss_of(
    network: nn.Module,
    samples: Samples,
    rows: IntArray,
    rng: np.random.Generator,
    config: TopologyConfig,
) -> Tensor:
    """Eq. 6.1 plus the classifier's loss. The rare class of nodes weighs more, in place of leaving
    others out."""
    batch = collate([samples[k] for k in rows])
    links, orientations, classes = network(*batch.inputs)
    entropy = nn.functional.binary_cross_entropy_with_logits
    angle_loss = entropy(orientations[batch.on], batch.angles[batch.on])
    class_loss = entropy(classes, batch.classes, pos_weight=torch.tensor(4.0))
    return entropy(links, batch.links) + angle_loss + class_loss


def measure(network: nn.Module, samples: Samples, config: TopologyConfig) -> dict[str, float]:
    """Dice of the links at 0.5, orientation errors, Dice of the classes."""
    batch = collate(samples)
    with torch.inference_mode():
        links, orientations, classes = network(*batch.inputs)
    angles = np.argmax(orientations.numpy(), axis=1)[batch.on.numpy()]
    true = np.argmax(batch.angles.numpy(), axis=1)[batch.on.numpy()]
    error = np.abs(angles - true)
    error = np.minimum(error, 180 - error)
    metrics = {
        "link_dice": _dice(links.numpy() > 0, batch.links.numpy() > 0),
        "orientation_median_deg": float(np.median(error)),
        "orientation_mean_deg": float(error.mean()),
        "branch_dice": _dice(classes[:, 0].numpy() > 0, batch.classes[:, 0].numpy() > 0),
        "crossing_dice": _dice(classes[:, 1].numpy() > 0, batch.classes[:, 1].numpy() > 0),
    }
    return {name: round(value, 4) for name, value in metrics.items()}


def without(samples: Samples, config: TopologyConfig) -> dict[str, Any]:
    """Every node linked to its two nearest candidates; the main axis of the patch as its
    orientation."""
    batch = collate(samples)
    patches, nodes, edges, features = (part.numpy() for part in batch.inputs)
    linked = np.zeros(edges.shape[1], bool)
    order = np.argsort(features[:, 0], kind="stable")
    taken = np.zeros(len(nodes), np.int64)
    for k in order:
        if (taken[edges[:, k]] < 2).all():
            taken[edges[:, k]] += 1
            linked[k] = True
    on = batch.on.numpy()
    # a patch has an even side here: the mean of its four shifted cuts has a middle
    odd = (
        sum(patches[on][:, y : y + PATCH - 1, x : x + PATCH - 1] for y in (0, 1) for x in (0, 1))
        / 4
    )
    angles = np.rad2deg(principal_angles(odd))
    away = np.mod(angles - np.argmax(batch.angles.numpy(), axis=1)[on], 180.0)
    away = np.minimum(away, 180.0 - away)
    return {
        "rule": "the two nearest nodes; main axis of the patch",
        "link_dice": round(_dice(linked, batch.links.numpy() > 0), 4),
        "orientation_median_deg": round(float(np.median(away)), 4),
        "orientation_mean_deg": round(float(away.mean()), 4),
    }


def _dice(found: BoolArray, true: BoolArray) -> float:
    both, either = int((found & true).sum()), int(found.sum()) + int(true.sum())
    return 2 * both / max(either, 1)


def exports(network: nn.Module, samples: Samples, config: TopologyConfig) -> list[Exported]:
    n, e = torch.export.Dim("nodes"), torch.export.Dim("edges")
    return [
        Exported(
            NAME,
            TopologyProbabilities(network),
            "topology",
            f"patches (n, {PATCH}, {PATCH}), nodes (n, {NODE_FEATURES}), edges (2, e) int64, "
            f"edge_features (e, {EDGE_FEATURES})",
            "trained from scratch on masks of random harnesses that training draws itself",
            {"patch_size": PATCH},
            [
                _example(nodes, edges, config.seed)
                for nodes, edges in ((60, 270), (2, 1), (3, 0), (700, 3000))
            ],
            [{0: n}, {0: n}, {1: e}, {0: e}],
            1e-3,
            ("patches", "nodes", "edges", "edge_features"),
            ("links", "orientations", "classes"),
        )
    ]


def _example(nodes: int, edges: int, seed: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    rng = torch.Generator().manual_seed(seed + nodes)
    return (
        torch.rand(nodes, PATCH, PATCH, generator=rng),
        torch.rand(nodes, NODE_FEATURES, generator=rng),
        torch.randint(0, nodes, (2, edges), generator=rng),
        torch.rand(edges, EDGE_FEATURES, generator=rng),
    )


FAMILY = Family(
    NAME,
    TopologyConfig,
    samples,
    lambda config, samples: TopologyNetwork(config.hidden),
    loss_of,
    measure,
    without,
    exports,
    least={"link_dice": 0.5},
)
