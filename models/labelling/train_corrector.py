"""Train the corrector of DLO-WSL (thesis 2.5.3) on crops of rendered scenes, and export it.

    python -m models.labelling.train_crops build/train_crops --textures TEXTURES.npz
    python -m models.labelling.train_crops build/held_out --textures TEXTURES.npz --seed 1000000 --scenes 60
    python -m models.labelling.train_corrector build/train_crops --held-out build/held_out

The state is kept in ``--state`` after every epoch, and a second start goes on from it. Prints one JSON line an
epoch and one at the end: configuration and metrics.
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

from models.export import Card, export
from models.labelling.correction import FIRST_SPREAD_PX
from models.labelling.crops import MIDDLE, SIZE
from models.labelling.lines import LineReading, read_lines, read_lines_at, weighed
from models.labelling.network_corrector import CorrectorNetwork, CorrectorProbabilities
from models.labelling.train_crops import Crops, contrast, read

NAME = "labelling_corrector"


@dataclass(frozen=True)
class TrainConfig:
    """``stop_after`` ends the training before its last epoch (0: does not). ``heat_px`` spread of the target around the
    true column; ``width`` share of ResNet-18's channels. The thesis: 50 epochs, batch 128, rate 5e-5, variance 8 px;
    here one cycle of a higher rate."""

    seed: int = 5
    epochs: int = 5
    stop_after: int = 0
    batch: int = 64
    rate: float = 2e-3
    weight_decay: float = 1e-2
    heat_px: float = 1.5
    width: float = 0.25


def train(
    config: TrainConfig, crops: Crops, held_out: Crops, state: Path, initial: Path | None = None
) -> CorrectorNetwork:
    """The trained network, in evaluation mode. Crops where another DLO is nearer to the middle teach nothing.
    ``initial``: the state of an earlier training to begin from."""
    torch.manual_seed(config.seed)
    known = np.flatnonzero(crops.margins >= 0)
    network = CorrectorNetwork(config.width)
    if initial is not None:
        network.load_state_dict(torch.load(initial, weights_only=True)["states"]["network"])
    optimizer = torch.optim.AdamW(network.parameters(), lr=config.rate, weight_decay=config.weight_decay)
    steps = config.epochs * (len(known) // config.batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, config.rate, total_steps=steps, pct_start=0.15)
    stateful = {"network": network, "optimizer": optimizer, "schedule": schedule}
    for epoch in range(_restore(state, config, stateful), config.stop_after or config.epochs):
        loss = _train_epoch(network, optimizer, schedule, config, crops, known, epoch)
        _save(state, config, stateful, epoch + 1)
        print(json.dumps({"epoch": epoch + 1, "loss": round(loss, 4), **evaluate(network, held_out)}), flush=True)
    return network.eval()


def _train_epoch(
    network: CorrectorNetwork,
    optimizer: torch.optim.Optimizer,
    schedule: torch.optim.lr_scheduler.LRScheduler,
    config: TrainConfig,
    crops: Crops,
    known: np.ndarray,
    epoch: int,
) -> float:
    rng = np.random.default_rng([config.seed, epoch])
    order = rng.permutation(known)
    network.train()
    losses = []
    for start in range(0, len(order) - config.batch + 1, config.batch):
        rows = np.sort(order[start : start + config.batch])
        images, columns = augment(crops.images[rows], crops.columns[rows], rng)
        with torch.autocast("cpu", torch.bfloat16):
            logits, sizes = network(images)
        loss = corrector_loss(logits.float(), sizes.float(), columns, torch.from_numpy(crops.widths[rows]), config)
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
        if len(losses) % 50 == 0:
            print(
                json.dumps({"epoch": epoch, "step": len(losses), "loss": round(float(np.mean(losses[-50:])), 4)}),
                flush=True,
            )
    return float(np.mean(losses))


def augment(images: np.ndarray, columns: np.ndarray, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Mirrored, turned upside down, recolored, brighter or darker, each at random: crops as float, and columns."""
    out = torch.from_numpy(images)
    at = torch.from_numpy(columns.copy())
    mirrored = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(mirrored[:, None, None, None], out.flip(2), out)
    at = torch.where(mirrored, SIZE - 1 - at, at)
    turned = torch.from_numpy(rng.random(len(at)) < 0.5)
    out = torch.where(turned[:, None, None, None], out.flip(1), out)[..., rng.permutation(3).tolist()].float()
    gain = torch.from_numpy(rng.uniform(0.7, 1.3, (len(at), 1, 1, 3)).astype(np.float32))
    lift = torch.from_numpy(rng.uniform(-25, 25, (len(at), 1, 1, 1)).astype(np.float32))
    return ((out - 127.5) * gain + 127.5 + lift).clamp(0, 255), at


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
    """Error of the offset, px, over ``count`` crops (thesis 2.7.3: mean 0.05, SD 1.57) that show which DLO is meant:
    it stands out from the ground by 12 of 255, and no other is within 4 px as near to the middle. ``any`` is over
    all crops, also those that a person could not mark; ``known_width`` is as DLO-WSL reads the line, with the DLO's
    thickness known to 10 %. And the error of the width."""
    rows = np.flatnonzero((crops.margins >= 4) & (contrast(crops) >= 12))[:count]
    reading = predict(network, crops.images[rows])
    error = reading.offsets - (crops.columns[rows] - MIDDLE)
    every = predict(network, crops.images[:count]).offsets - (crops.columns[:count] - MIDDLE)
    believed = crops.widths[rows] * np.exp(np.random.default_rng(0).normal(0, 0.1, len(rows)))
    known = predict(network, crops.images[rows], believed).offsets - (crops.columns[rows] - MIDDLE)
    relative = np.abs(np.log(reading.widths / crops.widths[rows]))
    return {
        "crops": float(len(rows)),
        "mean_px": round(float(error.mean()), 4),
        "sd_px": round(float(error.std()), 4),
        "mean_px_known_width": round(float(known.mean()), 4),
        "sd_px_known_width": round(float(known.std()), 4),
        "median_abs_px": round(float(np.median(np.abs(error))), 4),
        "over_3px": round(float((np.abs(error) > 3).mean()), 4),
        "median_abs_px_any": round(float(np.median(np.abs(every))), 4),
        "sd_px_any": round(float(every.std()), 4),
        "width_error": round(float(np.median(relative)), 4),
    }


def _save(path: Path, config: TrainConfig, stateful: dict[str, object], epoch: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    states = {name: part.state_dict() for name, part in stateful.items()}  # type: ignore[attr-defined]
    partial = path.with_suffix(".part")
    torch.save({"config": asdict(config), "epoch": epoch, "states": states}, partial)
    partial.replace(path)


def _restore(path: Path, config: TrainConfig, stateful: dict[str, object]) -> int:
    """The epoch to go on from; 0 without a state of this configuration."""
    if not path.exists():
        return 0
    state = torch.load(path, weights_only=True)
    # How many epochs are wanted of the same training does not make it another one; older states do not say.
    if {**state["config"], "stop_after": 0} != {**asdict(config), "stop_after": 0}:
        return 0
    for name, part in stateful.items():
        part.load_state_dict(state["states"][name])  # type: ignore[attr-defined]
    return int(state["epoch"])


def export_network(network: CorrectorNetwork, config: TrainConfig, crops: int, metrics: dict[str, float]) -> float:
    """Write the ONNX file and its manifest entry; returns the largest difference to torch."""
    card = Card(
        version="1",
        task="corrector",
        default=True,
        input=f"(n, {SIZE}, {SIZE}, 3) uint8 RGB crops, the DLO upright; outputs (n, {SIZE}) probability of each "
        f"column to be the centerline and (n, {SIZE}) width in pixels if it is",
        license="Apache-2.0",
        origin="trained from scratch by this repository on crops of scenes that it renders itself",
        preprocess={"size": SIZE},
        training={
            "command": "python -m models.labelling.train_corrector",
            "data": "models.labelling.train_crops: models.synthesis scenes, permissively licensed textures (NOTICE)",
            "crops": crops,
            **asdict(config),
        },
        metrics={f"rendered_{name}": value for name, value in metrics.items()},
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
    parser.add_argument("--held-out", type=Path, required=True)
    parser.add_argument("--state", type=Path, default=Path("build/train/labelling_corrector.pt"))
    parser.add_argument("--initial", type=Path, help="state of an earlier training to begin from")
    for name, default in asdict(TrainConfig()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default)
    args = parser.parse_args()
    torch.set_num_threads(1)
    config = TrainConfig(**{name: getattr(args, name) for name in asdict(TrainConfig())})
    crops, held_out = read(args.crops), read(args.held_out)
    network = train(config, crops, held_out, args.state, args.initial)
    metrics = evaluate(network, held_out)
    difference = export_network(network, config, int((crops.margins >= 0).sum()), metrics)
    print(json.dumps({"config": asdict(config), "metrics": metrics, "onnx_difference": difference}))


if __name__ == "__main__":
    main()
