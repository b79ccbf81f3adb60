"""Train the corrector of DLO-WSL (thesis 2.5.3) on crops of rendered scenes, and export it.

    python -m models.training.corrector.crops build/train_crops --textures TEXTURES.npz --seed 3 --scenes 2400 …
    python -m models.training.corrector.crops build/watched --textures TEXTURES.npz --seed 1000000 --scenes 300 …
    python -m models.training.corrector.corrector build/train_crops --watched build/watched

The state is kept in ``--state`` after every epoch, and a second start goes on from it. Prints one JSON line an
epoch and one at the end: configuration and metrics. What is exported is the running mean of the weights after the
last epoch. The figures that are reported are of other crops than the watched ones: ``tests.benchmarks.bench_tracked``.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from models.geometry.arrays import BoolArray, IntArray
from models.tracked_labels.correction import FIRST_SPREAD_PX
from models.tracked_labels.crops import MIDDLE, SIZE
from models.tracked_labels.lines import LineReading, read_lines, read_lines_at, weighed
from models.training.corrector.crops import Crops, contrast, read
from models.training.corrector.network_corrector import CorrectorNetwork, CorrectorProbabilities
from models.training.export import Card, export
from models.training.state import restore, save

NAME = "labelling_corrector"


@dataclass(frozen=True)
class TrainConfig:
    """``heat_px`` spread of the target around the true column; ``width`` share of ResNet-18's channels; ``keep``: how
    much of the running mean of the weights a step leaves. The thesis: 50 epochs, batch 128, rate 5e-5, variance 8 px;
    here one cycle of a higher rate over more crops."""

    seed: int = 7
    epochs: int = 5
    batch: int = 64
    rate: float = 2e-3
    weight_decay: float = 2e-2
    heat_px: float = 1.5
    width: float = 0.375
    keep: float = 0.998


@dataclass(frozen=True)
class Course:
    """All that a step changes: what is saved and taken up again."""

    network: CorrectorNetwork
    mean: AveragedModel
    optimizer: torch.optim.Optimizer
    schedule: torch.optim.lr_scheduler.LRScheduler

    @classmethod
    def begun(cls, config: TrainConfig, crops: int) -> Course:
        network = CorrectorNetwork(config.width)
        optimizer = torch.optim.AdamW(network.parameters(), lr=config.rate, weight_decay=config.weight_decay)
        steps = config.epochs * (crops // config.batch)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, config.rate, total_steps=steps, pct_start=0.15)
        mean = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(config.keep), use_buffers=True)
        return cls(network, mean, optimizer, schedule)

    def averaged(self) -> CorrectorNetwork:
        assert isinstance(self.mean.module, CorrectorNetwork)
        return self.mean.module.eval()


def train(config: TrainConfig, crops: Crops, watched: Crops, state: Path) -> CorrectorNetwork:
    """The trained network, in evaluation mode. Crops where another DLO is nearer to the middle teach nothing."""
    torch.manual_seed(config.seed)
    known = np.flatnonzero(crops.margins >= 0)
    course = Course.begun(config, len(known))
    for epoch in range(restore(state, asdict(config), vars(course)), config.epochs):
        loss = _train_epoch(course, config, crops, known, epoch)
        save(state, asdict(config), vars(course), epoch + 1)
        print(json.dumps({"epoch": epoch + 1, "loss": loss, **evaluate(course.averaged(), watched)}), flush=True)
    return course.averaged()


def _train_epoch(course: Course, config: TrainConfig, crops: Crops, known: IntArray, epoch: int) -> float:
    """Mean loss of the last quarter of the epoch."""
    rng = np.random.default_rng([config.seed, epoch])
    order = rng.permutation(known)
    course.network.train()
    losses = []
    for start in range(0, len(order) - config.batch + 1, config.batch):
        rows = np.sort(order[start : start + config.batch])
        images, columns = augment(crops.images[rows], crops.columns[rows], rng)
        with torch.autocast("cpu", torch.bfloat16):
            logits, sizes = course.network(images)
        loss = corrector_loss(logits.float(), sizes.float(), columns, torch.from_numpy(crops.widths[rows]), config)
        course.optimizer.zero_grad()
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(course.network.parameters(), 2.0)
        course.optimizer.step()
        course.schedule.step()
        course.mean.update_parameters(course.network)
        losses.append(loss.item())
        if len(losses) % 200 == 0:
            print(
                json.dumps({"epoch": epoch, "step": len(losses), "loss": np.mean(losses[-200:]).round(4)}), flush=True
            )
    return round(float(np.mean(losses[-max(len(losses) // 4, 1) :])), 4)


def augment(images: np.ndarray, columns: np.ndarray, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Mirrored, turned upside down, recolored, brighter or darker, blurred, noisy, each at random: crops as float, and
    columns."""
    out = torch.from_numpy(images)
    at = torch.from_numpy(columns.copy())
    mirrored = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(mirrored[:, None, None, None], out.flip(2), out)
    at = torch.where(mirrored, SIZE - 1 - at, at)
    turned = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(turned[:, None, None, None], out.flip(1), out)[..., rng.permutation(3).tolist()].float()
    gain = torch.from_numpy(rng.uniform(0.7, 1.3, (len(at), 1, 1, 3)).astype(np.float32))
    lift = torch.from_numpy(rng.uniform(-25, 25, (len(at), 1, 1, 1)).astype(np.float32))
    out = torch.addcmul(lift + 127.5 * (1 - gain), out, gain)
    soft = torch.from_numpy(rng.random(len(at)) < 0.2)
    if soft.any():
        blurred = F.avg_pool2d(out[soft].permute(0, 3, 1, 2), 3, 1, 1, count_include_pad=False)
        out[soft] = blurred.permute(0, 2, 3, 1)
    grainy = torch.from_numpy(rng.random(len(at)) < 0.25)
    grain = rng.standard_normal(out[grainy].shape, np.float32) * rng.uniform(1, 8, (int(grainy.sum()), 1, 1, 1))
    out[grainy] += torch.from_numpy(grain.astype(np.float32))
    return out.clamp(0, 255), at


def corrector_loss(logits: Tensor, sizes: Tensor, columns: Tensor, widths: Tensor, config: TrainConfig) -> Tensor:
    """Cross entropy to a Gaussian around the true column, and the error of the logarithm of the width there."""
    away = torch.arange(SIZE)[None] - columns[:, None]
    target = torch.softmax(-(away**2) / (2 * config.heat_px**2), 1)
    line = -(target * F.log_softmax(logits, 1)).sum(1).mean()
    error = F.smooth_l1_loss(sizes, widths.log()[:, None].expand_as(sizes), reduction="none", beta=0.1)
    return line + 2.0 * (target * error).sum(1).mean()


@torch.no_grad()
def predict(network: CorrectorNetwork, images: np.ndarray, believed: np.ndarray | None = None) -> LineReading:
    """What the exported network and the reading of its lines say of (n, SIZE, SIZE, 3) crops; ``believed`` (n,) widths
    are what DLO-WSL knows of the DLO."""
    probabilities = CorrectorProbabilities(network).eval()
    parts = [probabilities(torch.from_numpy(images[k : k + 64])) for k in range(0, len(images), 64)]
    columns, widths = (torch.cat(part).numpy() for part in zip(*parts, strict=True))
    if believed is None:
        return read_lines(columns, widths)
    return read_lines_at(columns, widths, weighed(columns, widths, believed, FIRST_SPREAD_PX).argmax(1))


def evaluate(network: CorrectorNetwork, crops: Crops, count: int = 1000) -> dict[str, float]:
    """Of at most ``count`` crops that a person could mark (:func:`marked`)."""
    chosen = crops.take(np.flatnonzero(marked(crops))[:count])
    reading = predict(network, chosen.images)
    believed = chosen.widths * np.exp(np.random.default_rng(0).normal(0, 0.1, len(chosen.widths)))
    known = predict(network, chosen.images, believed)
    return {**errors(reading, chosen), "sd_px_known_width": errors(known, chosen)["sd_px"]}


def marked(crops: Crops) -> BoolArray:
    """(n,) crops that show which DLO is meant: it stands out from the ground by 12 of 255, and no other is within 4 px
    as near to the middle."""
    out: BoolArray = (crops.margins >= 4) & (contrast(crops) >= 12)
    return out


def errors(reading: LineReading, crops: Crops) -> dict[str, float]:
    """Error of the offset, px, as in thesis 2.7.3 (mean 0.05, SD 1.57), and of the width (relative)."""
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


def export_network(network: CorrectorNetwork, config: TrainConfig, crops: int, metrics: dict[str, float]) -> float:
    """Write the ONNX file and its manifest entry; returns the largest difference to torch."""
    card = Card(
        version="2",
        task="corrector",
        default=True,
        input=f"(n, {SIZE}, {SIZE}, 3) uint8 RGB crops, the DLO upright; outputs (n, {SIZE}) probability of each "
        f"column to be the centerline and (n, {SIZE}) width in pixels if it is",
        license="Apache-2.0",
        origin="trained from scratch by this repository on crops of scenes that it renders itself",
        preprocess={"size": SIZE},
        training={
            "command": "python -m models.training.corrector.corrector",
            "data": "models.training.corrector.crops: models.synthesis scenes, permissively licensed textures (NOTICE)",
            "crops": crops,
            **asdict(config),
        },
        metrics={f"watched_{name}": value for name, value in metrics.items()},
    )
    rng = torch.Generator().manual_seed(config.seed)
    shape = (SIZE, SIZE, 3)
    examples = [torch.randint(0, 256, (n, *shape), generator=rng, dtype=torch.uint8) for n in (2, 1, 7, 40)]
    return export(
        CorrectorProbabilities(network), NAME, card, examples, {0: torch.export.Dim("n")}, tolerance=1e-3,
        inputs=("crops",), outputs=("columns", "widths"),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("crops", type=Path)
    parser.add_argument("--watched", type=Path, required=True)
    parser.add_argument("--state", type=Path, default=Path("build/train/labelling_corrector.pt"))
    for name, default in asdict(TrainConfig()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default)
    args = parser.parse_args()
    torch.set_num_threads(1)
    config = TrainConfig(**{name: getattr(args, name) for name in asdict(TrainConfig())})
    crops, watched = read(args.crops), read(args.watched)
    network = train(config, crops, watched, args.state)
    metrics = evaluate(network, watched)
    difference = export_network(network, config, int((crops.margins >= 0).sum()), metrics)
    print(json.dumps({"config": asdict(config), "metrics": metrics, "onnx_difference": difference}))


if __name__ == "__main__":
    main()
