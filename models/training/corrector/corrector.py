"""The corrector of DLO-WSL (thesis 2.5.3), trained on crops of rendered scenes.

    python -m models.training.corrector.crops build/train_crops --textures TEXTURES.npz --seed 3 --scenes 2400 …
    python -m models.training.corrector.crops build/watched --textures TEXTURES.npz --seed 1000000 --scenes 300 …
    python -m models.training labelling_corrector --data build/train_crops --watched build/watched

The figures that are reported are of other crops than the watched ones:
``tests.benchmarks.bench_tracked``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from models.geometry.arrays import BoolArray, IntArray
from models.tracked_labels.correction import FIRST_SPREAD_PX
from models.tracked_labels.crops import MIDDLE, SIZE
from models.tracked_labels.lines import LineReading, read_lines, read_lines_at, weighed
from models.training.corrector.crops import Crops, contrast, read
from models.training.corrector.network_corrector import CorrectorNetwork, CorrectorProbabilities
from models.training.export import Exported
from models.training.fit import Family, Source
from models.training.state import Config

NAME = "labelling_corrector"


@dataclass(frozen=True)
class CorrectorConfig(Config):
    """``heat_px`` spread of the target around the true column; ``width`` share of ResNet-18's
    channels. The thesis: 50 epochs, batch 128, rate 5e-5, variance 8 px; here one cycle of a higher
    rate over more crops."""

    seed: int = 7
    epochs: int = 5
    warm_up: float = 0.15
    weight_decay: float = 2e-2
    clip: float = 2.0
    keep: float = 0.998
    heat_px: float = 1.5
    width: float = 0.375


def samples(config: CorrectorConfig, source: Source) -> tuple[Crops, Crops]:
    """Crops where another DLO is nearer to the middle teach nothing: they are left out."""
    assert source.data is not None
    assert source.watched is not None
    crops = read(source.data)
    return crops.take(np.flatnonzero(crops.margins >= 0)), read(source.watched)


def loss_of(
    network: nn.Module,
    crops: Crops,
    rows: IntArray,
    rng: np.random.Generator,
    config: CorrectorConfig,
) -> Tensor:
    images, columns = augment(crops.images[rows], crops.columns[rows], rng)
    with torch.autocast("cpu", torch.bfloat16):
        logits, sizes = network(images)
    return corrector_loss(
        logits.float(), sizes.float(), columns, torch.from_numpy(crops.widths[rows]), config.heat_px
    )


def augment(
    images: np.ndarray, columns: np.ndarray, rng: np.random.Generator
) -> tuple[Tensor, Tensor]:
    """Mirrored, turned upside down, recolored, brighter or darker, blurred, noisy, each at random:
    crops as float, and columns."""
    out = torch.from_numpy(images)
    at = torch.from_numpy(columns.copy())
    mirrored = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(mirrored[:, None, None, None], out.flip(2), out)
    at = torch.where(mirrored, SIZE - 1 - at, at)
    turned = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(turned[:, None, None, None], out.flip(1), out)[
        ..., rng.permutation(3).tolist()
    ].float()
    gain = torch.from_numpy(rng.uniform(0.7, 1.3, (len(at), 1, 1, 3)).astype(np.float32))
    lift = torch.from_numpy(rng.uniform(-25, 25, (len(at), 1, 1, 1)).astype(np.float32))
    out = torch.addcmul(lift + 127.5 * (1 - gain), out, gain)
    soft = torch.from_numpy(rng.random(len(at)) < 0.2)
    if soft.any():
        blurred = F.avg_pool2d(out[soft].permute(0, 3, 1, 2), 3, 1, 1, count_include_pad=False)
        out[soft] = blurred.permute(0, 2, 3, 1)
    grainy = torch.from_numpy(rng.random(len(at)) < 0.25)
    grain = rng.standard_normal(out[grainy].shape, np.float32) * rng.uniform(
        1, 8, (int(grainy.sum()), 1, 1, 1)
    )
    out[grainy] += torch.from_numpy(grain.astype(np.float32))
    return out.clamp(0, 255), at


def corrector_loss(
    logits: Tensor, sizes: Tensor, columns: Tensor, widths: Tensor, heat_px: float
) -> Tensor:
    """Cross entropy to a Gaussian around the true column, and the error of the logarithm of the
    width there."""
    away = torch.arange(SIZE)[None] - columns[:, None]
    target = torch.softmax(-(away**2) / (2 * heat_px**2), 1)
    line = -(target * F.log_softmax(logits, 1)).sum(1).mean()
    error = F.smooth_l1_loss(
        sizes, widths.log()[:, None].expand_as(sizes), reduction="none", beta=0.1
    )
    return line + 2.0 * (target * error).sum(1).mean()


@torch.no_grad()
def predict(
    network: nn.Module, images: np.ndarray, believed: np.ndarray | None = None
) -> LineReading:
    """What the exported network and the reading of its lines say of (n, SIZE, SIZE, 3) crops;
    ``believed`` (n,) widths are what DLO-WSL knows of the DLO."""
    probabilities = CorrectorProbabilities(network).eval()
    parts = [probabilities(torch.from_numpy(images[k : k + 64])) for k in range(0, len(images), 64)]
    columns, widths = (torch.cat(part).numpy() for part in zip(*parts, strict=True))
    if believed is None:
        return read_lines(columns, widths)
    return read_lines_at(
        columns, widths, weighed(columns, widths, believed, FIRST_SPREAD_PX).argmax(1)
    )


def measure(
    network: nn.Module, crops: Crops, config: CorrectorConfig, count: int = 1000
) -> dict[str, float]:
    """Of at most ``count`` crops that a person could mark (:func:`marked`)."""
    chosen = crops.take(np.flatnonzero(marked(crops))[:count])
    if not len(chosen):
        raise ValueError(
            "none of the watched crops shows which DLO is meant: there is nothing to measure on"
        )
    reading = predict(network, chosen.images)
    believed = chosen.widths * np.exp(np.random.default_rng(0).normal(0, 0.1, len(chosen.widths)))
    known = predict(network, chosen.images, believed)
    figures = {**errors(reading, chosen), "sd_px_known_width": errors(known, chosen)["sd_px"]}
    uncorrected = float(np.abs(chosen.columns - MIDDLE).mean())
    figures["gain_px"] = round(
        uncorrected - float(np.abs(reading.offsets - (chosen.columns - MIDDLE)).mean()), 4
    )
    return {f"watched_{name}": value for name, value in figures.items()}


def without(crops: Crops, config: CorrectorConfig, count: int = 1000) -> dict[str, Any]:
    chosen = crops.take(np.flatnonzero(marked(crops))[:count])
    error = chosen.columns - MIDDLE
    figures = {
        "mean_px": round(float(-error.mean()), 4),
        "sd_px": round(float(error.std()), 4),
        "median_abs_px": round(float(np.median(np.abs(error))), 4),
        "over_3px": round(float((np.abs(error) > 3).mean()), 4),
    }
    return {
        "rule": "the line as it was drawn",
        **{f"watched_{name}": value for name, value in figures.items()},
    }


def marked(crops: Crops) -> BoolArray:
    """(n,) crops that show which DLO is meant: it stands out from the ground by 12 of 255, and no
    other is within 4 px as near to the middle."""
    out: BoolArray = (crops.margins >= 4) & (contrast(crops) >= 12)
    return out


def errors(reading: LineReading, crops: Crops) -> dict[str, float]:
    """Error of the offset, px, as in thesis 2.7.3 (mean 0.05, SD 1.57), and of the width
    (relative)."""
    error = reading.offsets - (crops.columns - MIDDLE)
    relative = np.abs(np.log(reading.widths / crops.widths))
    return {
        "crops": float(len(error)),
        "mean_px": round(float(error.mean()), 4),
        "sd_px": round(float(error.std()), 4),
        "median_abs_px": round(float(np.median(np.abs(error))), 4),
        "over_3px": round(float((np.abs(error) > 3).mean()), 4),
        "width_error": round(float(np.median(relative)), 4),
    }


def exports(network: nn.Module, crops: Crops, config: CorrectorConfig) -> list[Exported]:
    rng = torch.Generator().manual_seed(config.seed)
    shape = (SIZE, SIZE, 3)
    return [
        Exported(
            NAME,
            CorrectorProbabilities(network),
            "corrector",
            f"(n, {SIZE}, {SIZE}, 3) uint8 RGB crops, the DLO upright; outputs (n, {SIZE}) probability of each "
            f"column to be the centerline and (n, {SIZE}) width in pixels if it is",
            "trained from scratch by this repository on crops of scenes that it renders itself",
            {"size": SIZE},
            [
                (torch.randint(0, 256, (n, *shape), generator=rng, dtype=torch.uint8),)
                for n in (2, 1, 7, 40)
            ],
            [{0: torch.export.Dim("n")}],
            1e-3,
            ("crops",),
            ("columns", "widths"),
            version="2",
            facts={
                "data": "models.training.corrector.crops: models.synthesis scenes, permissively licensed textures"
                " (NOTICE)"
            },
        )
    ]


FAMILY = Family(
    NAME,
    CorrectorConfig,
    samples,
    lambda config, crops: CorrectorNetwork(config.width),
    loss_of,
    measure,
    without,
    exports,
    least={"watched_gain_px": 0.0},  # otherwise the stroke may as well stay where it is
    needs=("data", "watched"),
)
