"""RT-DLO's orientation network, trained on patches that are drawn for it: a few minutes on one
core."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import Float32Array, FloatArray, IntArray
from models.instances.published.rt_dlo.orientation import (
    CLASSES,
    PATCH_SIZE,
    angles_from_scores,
    principal_angles,
)
from models.training.export import Exported
from models.training.fit import Family, Source
from models.training.instances.rt_dlo_network_orientation import (
    OrientationNetwork,
    OrientationProbabilities,
)
from models.training.instances.rt_dlo_patches import make_patches
from models.training.state import Config

NAME = "rt_dlo_orientation"


@dataclass(frozen=True)
class OrientationConfig(Config):
    """Patches are drawn anew every epoch; the held-out ones come from another seed."""

    seed: int = 7
    epochs: int = 24
    batch: int = 256
    rate: float = 3e-3
    patches: int = 60_000
    held_out: int = 20_000
    label_sigma_deg: float = 4.0


@dataclass(frozen=True, eq=False)
class Patches:
    """``count`` patches: ``(n, s, s)`` ``pixels`` and ``(n,)`` ``angles``, which are drawn when an
    epoch begins."""

    count: int
    pixels: Float32Array = field(
        default_factory=lambda: np.zeros((0, PATCH_SIZE, PATCH_SIZE), np.float32)
    )
    angles: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        return self.count


def drawn(patches: Patches, config: OrientationConfig, rng: np.random.Generator) -> Patches:
    return Patches(len(patches), *make_patches(len(patches), rng))


def samples(config: OrientationConfig, source: Source) -> tuple[Patches, Patches]:
    rng = np.random.default_rng([config.seed, 10**6])
    return Patches(config.patches), drawn(Patches(config.held_out), config, rng)


def encode_angles(angles: FloatArray, sigma_deg: float) -> Tensor:
    """``(n,)`` radians to ``(n, 180)`` targets: a periodic Gaussian of height 1 around the
    angle."""
    away = np.abs(np.arange(CLASSES)[None] - np.rad2deg(angles)[:, None])
    away = np.minimum(away, CLASSES - away)
    return torch.from_numpy(np.exp(-(away**2) / (2 * sigma_deg**2)).astype(np.float32))


def angular_errors_deg(predicted: FloatArray, true: FloatArray) -> FloatArray:
    """``(n,)`` differences of two undirected orientations, 0 to 90 degrees."""
    away = np.mod(np.rad2deg(predicted - true), 180.0)
    return np.minimum(away, 180.0 - away)


def loss_of(
    network: nn.Module,
    patches: Patches,
    rows: IntArray,
    rng: np.random.Generator,
    config: OrientationConfig,
) -> Tensor:
    targets = encode_angles(patches.angles[rows], config.label_sigma_deg)
    return nn.functional.binary_cross_entropy_with_logits(
        network(torch.from_numpy(patches.pixels[rows])), targets
    )


def measure(network: nn.Module, patches: Patches, config: OrientationConfig) -> dict[str, float]:
    """Errors in degrees; ``gain_deg``: how much less the mean is than without the network."""
    with torch.inference_mode():
        predicted = angles_from_scores(network(torch.from_numpy(patches.pixels)).numpy())
    figures = _figures(predicted, patches)
    return {
        **figures,
        "gain_deg": round(without(patches, config)["mean_deg"] - figures["mean_deg"], 3),
    }


def without(patches: Patches, config: OrientationConfig) -> dict[str, Any]:
    return {"rule": "main axis of the patch", **_figures(principal_angles(patches.pixels), patches)}


def _figures(guess: FloatArray, patches: Patches) -> dict[str, float]:
    errors = angular_errors_deg(guess, patches.angles)
    return {
        "mean_deg": round(float(errors.mean()), 3),
        "median_deg": round(float(np.median(errors)), 3),
        "over_20_deg": round(float((errors > 20).mean()), 4),
    }


def exports(network: nn.Module, patches: Patches, config: OrientationConfig) -> list[Exported]:
    rng = torch.Generator().manual_seed(config.seed)
    return [
        Exported(
            NAME,
            OrientationProbabilities(network),
            "orientation",
            f"(n, {PATCH_SIZE}, {PATCH_SIZE}) float32: distance transform around a vertex, in radii",
            "trained from scratch on masks of random strands that training draws itself",
            {"patch_size": PATCH_SIZE, "classes": CLASSES},
            [(torch.rand(n, PATCH_SIZE, PATCH_SIZE, generator=rng),) for n in (2, 0, 1, 7, 300)],
            [{0: torch.export.Dim("n")}],
            1e-4,
        )
    ]


FAMILY = Family(
    NAME,
    OrientationConfig,
    samples,
    lambda config, patches: OrientationNetwork(),
    loss_of,
    measure,
    without,
    exports,
    least={"gain_deg": 0.0},  # otherwise the main axis would do
    epoch=drawn,
)
