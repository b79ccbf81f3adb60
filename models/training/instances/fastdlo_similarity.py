"""FASTDLO's similarity network, trained with a triplet loss on rendered crossings: two minutes on
one core."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import Float32Array, IntArray
from models.instances.published.fastdlo.similarity import FEATURES, features, probabilities
from models.synthesis.crossings import RenderedCrossing, crop
from models.training.export import Exported
from models.training.fit import Family
from models.training.instances.crossing_samples import CrossingConfig, Crossings, crossing_samples
from models.training.instances.fastdlo_network_similarity import EMBEDDING, SimilarityNetwork

NAME = "fastdlo_similarity"
_ALIKE = 0.1
"""Distance of RGB, 0 to 1, up to which strands have about one color."""
_PLAIN = 6
"""Features that compare two endpoints."""
_WIDTH_NOISE, _ANGLE_NOISE = 0.2, np.deg2rad(12.0)


@dataclass(frozen=True)
class SimilarityConfig(CrossingConfig):
    """Where on the crossings the endpoints are is drawn anew every epoch; ``batch`` crossings give
    some 4 triplets each; ``margin`` of the triplet loss."""

    epochs: int = 25
    batch: int = 128
    margin: float = 1.0


def endpoints_of(scene: RenderedCrossing, rng: np.random.Generator) -> Float32Array:
    """``(2 k, 7)`` features at both sides of the crossing of the k strands; rows 2 i and 2 i + 1
    are strand i's.

    Endpoints are up to three widths away; width and direction get the errors that a mask leaves.
    """
    colors, widths, outward = [], [], []
    for strand in scene.strands:
        for side in (-1, 1):
            offset = side * strand.width_px * rng.uniform(0.8, 3.0)
            patch = crop(scene.rgb, strand.at(offset), max(1, round(0.5 * strand.width_px)), 3)
            colors.append(np.median(patch.reshape(-1, 3), axis=0))
            widths.append(strand.width_px * np.exp(rng.normal(0, _WIDTH_NOISE)))
            (x, y), turn = strand.outward(offset), rng.normal(0, _ANGLE_NOISE)
            outward.append(
                (x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn))
            )
    return features(np.array(colors), np.array(widths), np.array(outward))


def triplets(
    scenes: list[RenderedCrossing], rng: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """``(n, 7)`` anchors, positives (other side of the strand), negatives (other strands of the
    crossing)."""
    anchors, positives, negatives = [], [], []
    for scene in scenes:
        rows = endpoints_of(scene, rng)
        for k in range(len(rows)):
            others = [j for j in range(len(rows)) if j // 2 != k // 2]
            anchors.append(rows[k])
            positives.append(rows[k ^ 1])
            negatives.append(rows[rng.choice(others)])
    anchor, positive, negative = (
        torch.from_numpy(np.stack(part)) for part in (anchors, positives, negatives)
    )
    return anchor, positive, negative


def loss_of(
    network: nn.Module,
    scenes: Crossings,
    rows: IntArray,
    rng: np.random.Generator,
    config: SimilarityConfig,
) -> Tensor:
    """Triplet loss over squared distances of the embeddings."""
    anchor, positive, negative = (
        network(part) for part in triplets([scenes[k] for k in rows], rng)
    )
    near, far = ((anchor - positive) ** 2).sum(1), ((anchor - negative) ** 2).sum(1)
    return torch.relu(near - far + config.margin).mean()


def measure(network: nn.Module, scenes: Crossings, config: SimilarityConfig) -> dict[str, float]:
    """Share of endpoints whose most probable partner is the other side of their strand; mean
    probabilities."""
    rng = np.random.default_rng(0)
    right: list[bool] = []
    alike: list[bool] = []
    same: list[float] = []
    other: list[float] = []
    for scene in scenes:
        ends = endpoints_of(scene, rng)
        with torch.inference_mode():
            embedded = network(torch.from_numpy(ends)).numpy()
        table = probabilities(embedded[:, None] - embedded[None])
        np.fill_diagonal(table, -1)
        rows = np.arange(len(table))
        right.extend(table.argmax(axis=1) == rows ^ 1)
        alike.extend(np.full(len(rows), _alike(ends)))
        same.extend(table[rows, rows ^ 1])
        other.extend(table[rows, (rows + 2) % len(rows)])
    named: dict[str, list[Any]] = {
        "partner_right": right,
        "same_strand": same,
        "other_strand": other,
    }
    figures = {name: round(float(np.mean(values)), 4) for name, values in named.items()}
    return figures | _of_alike(right, alike)


def _alike(ends: Float32Array) -> bool:
    """Whether the strands of an intersection have about one color; ``ends`` (2 k, 7), a strand's
    two after another."""
    colors = ends[:, :3].reshape(-1, 2, 3).mean(axis=1)
    return bool(np.linalg.norm(colors[:, None] - colors[None], axis=2).max() < _ALIKE)


def _of_alike(right: list[bool], alike: list[bool]) -> dict[str, float]:
    of_them = np.array(right)[np.array(alike, bool)]
    return {"partner_right_alike": round(float(of_them.mean()), 4)} if len(of_them) else {}


def without(scenes: Crossings, config: SimilarityConfig) -> dict[str, Any]:
    """The endpoint with the nearest features, each in units of its own spread."""
    rng = np.random.default_rng(0)
    rows = [endpoints_of(scene, rng) for scene in scenes]
    spread = np.concatenate(rows).std(axis=0) + 1e-6
    right: list[bool] = []
    alike: list[bool] = []
    for ends in rows:
        apart = np.linalg.norm(((ends[:, None] - ends[None]) / spread)[..., :_PLAIN], axis=2)
        alike.extend(np.full(len(ends), _alike(ends)))
        np.fill_diagonal(apart, np.inf)
        right.extend(apart.argmin(axis=1) == np.arange(len(apart)) ^ 1)
    figures = {"partner_right": round(float(np.mean(right)), 4)}
    return {"rule": "nearest color, width and direction", **figures, **_of_alike(right, alike)}


def exports(network: nn.Module, scenes: Crossings, config: SimilarityConfig) -> list[Exported]:
    return [
        Exported(
            NAME,
            network,
            "similarity",
            f"(n, {FEATURES}) float32: RGB 0 to 1, log relative width, cos and sin of twice the direction, "
            "log spread of the colors",
            "trained from scratch on crossings that this repository renders",
            {"embedding": EMBEDDING},
            [(torch.rand(n, FEATURES),) for n in (4, 0, 1, 7)],
            [{0: torch.export.Dim("n")}],
            1e-4,
        )
    ]


FAMILY = Family(
    NAME,
    SimilarityConfig,
    crossing_samples,
    lambda config, scenes: SimilarityNetwork(),
    loss_of,
    measure,
    without,
    exports,
    least={"partner_right": 0.4},  # one of three other ends is right by chance
)
