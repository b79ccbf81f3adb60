"""Train a dynamics network on simulated samples: ``python -m models.training.dynamics.train FOLDER --data FILE``.

Resumable; bounded by processor minutes, summed over all runs on the same folder, which the learning rate follows.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from models.training.dynamics.data import Samples
from models.training.dynamics.networks import NETWORKS, build, frame_of, tensors

_HELD_OUT = 0.1


@dataclass(frozen=True)
class TrainParams:
    """``minutes`` of processor time in all; thesis 5.7.1 trains 100 epochs at batch 128."""

    network: str = "dynamics"
    conditioned: bool = True
    minutes: float = 30.0
    batch: int = 512
    rate: float = 1.5e-3
    decay: float = 0.999
    seed: int = 1


def learning_rate(share: float, peak: float) -> float:
    """Warm-up over the first 2 %, then half a cosine down to 0.1 % of ``peak``."""
    warm = min(share / 0.02, 1.0)
    return peak * warm * (0.001 + 0.999 * 0.5 * (1 + math.cos(math.pi * min(share, 1.0))))


def node_error(predicted: Tensor, true: Tensor) -> Tensor:
    """Mean distance a node, (B,) m."""
    return (predicted - true).norm(dim=-1).mean(1)


def loss_of(predicted: Tensor, true: Tensor) -> Tensor:
    """Mean squared error (5.4.3) in units of a centimeter, its square root taken a sample at a time: large motions
    do not outweigh small ones."""
    squared = (1e4 * (predicted - true).square()).sum(-1).mean(1)
    return (squared + 1e-4).sqrt().mean()


class Training:
    """Network, its running average and the optimizer: what a checkpoint holds."""

    def __init__(self, params: TrainParams) -> None:
        torch.manual_seed(params.seed)
        self.params = params
        self.network = build(params.network, params.conditioned)
        self.average = build(params.network, params.conditioned).requires_grad_(False)
        self.average.load_state_dict(self.network.state_dict())
        self.optimizer = torch.optim.AdamW(self.network.parameters(), lr=params.rate, weight_decay=1e-4)
        self.seconds, self.steps = 0.0, 0

    def run(self, data: tuple[Tensor, ...], until_s: float) -> None:
        """Steps on random batches until ``seconds`` of processor time have been spent."""
        rows = torch.Generator().manual_seed(self.params.seed + self.steps)
        while self.seconds < until_s:
            started = time.process_time()
            order = torch.randperm(len(data[0]), generator=rows)[: 64 * self.params.batch]
            for picked in order.split(self.params.batch):
                self._step(tuple(column[picked] for column in data))
            self.seconds += time.process_time() - started

    def _step(self, batch: tuple[Tensor, ...]) -> None:
        rate = learning_rate(self.seconds / (60 * self.params.minutes), self.params.rate)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        *inputs, true = batch
        loss = loss_of(self.network(*inputs), true)
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.steps += 1
        decay = min(self.params.decay, self.steps / (10 + self.steps))
        with torch.no_grad():
            for kept, new in zip(self.average.parameters(), self.network.parameters(), strict=True):
                kept.lerp_(new, 1 - decay)

    def save(self, file: Path, metrics: dict[str, float]) -> None:
        state = {
            "network": self.network.state_dict(), "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(), "seconds": self.seconds, "steps": self.steps,
            "params": asdict(self.params), "metrics": metrics,
        }  # fmt: skip
        partial = file.with_suffix(".part")
        torch.save(state, partial)
        partial.replace(file)

    def restore(self, file: Path) -> None:
        """Raises ValueError when the file is of another network."""
        state = torch.load(file, weights_only=True)
        same = ("network", "conditioned", "batch", "seed")
        if any(state["params"][name] != getattr(self.params, name) for name in same):
            raise ValueError(f"{file} was begun with {state['params']}")
        self.network.load_state_dict(state["network"])
        self.average.load_state_dict(state["average"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.seconds, self.steps = state["seconds"], state["steps"]


@torch.inference_mode()
def evaluate(network: nn.Module, data: tuple[Tensor, ...]) -> dict[str, float]:
    """Mean node error, and its ratio to the mean displacement of a node."""
    parts = []
    for rows in torch.arange(len(data[0])).split(4096):
        *inputs, true = (column[rows] for column in data)
        parts.append((node_error(network(*inputs), true), node_error(inputs[0], true)))
    error, moved = (torch.cat(column) for column in zip(*parts, strict=True))
    return {
        "error_mm": round(1e3 * float(error.mean()), 4),
        "median_mm": round(1e3 * float(error.median()), 4),
        "error_share": round(float(error.mean() / moved.mean()), 5),
    }


def split(samples: Samples) -> tuple[Samples, Samples]:
    """Training and validation. Sequences lie apart by whole chunks, so the last tenth shares none with the rest."""
    kept = round((1 - _HELD_OUT) * len(samples))
    return samples.taken(slice(0, kept)), samples.taken(slice(kept, None))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m models.training.dynamics.train", description=__doc__)
    parser.add_argument("folder", type=Path, help="continues from last.pt when it is there")
    parser.add_argument("--data", type=Path, required=True, help="of models.training.dynamics.data")
    parser.add_argument("--network", choices=list(NETWORKS), default="dynamics")
    parser.add_argument("--without-parameters", action="store_true", help="not conditioned on the rope")
    parser.add_argument("--minutes", type=float, default=TrainParams.minutes)
    parser.add_argument("--seed", type=int, default=TrainParams.seed)
    args = parser.parse_args()
    torch.set_num_threads(1)
    params = TrainParams(args.network, not args.without_parameters, args.minutes, seed=args.seed)
    training = Training(params)
    args.folder.mkdir(parents=True, exist_ok=True)
    file = args.folder / "last.pt"
    if file.exists():
        training.restore(file)
    parts = split(Samples.load(args.data))
    data, held_out = (tensors(part, frame_of(args.network)) for part in parts)
    while training.seconds < 60 * args.minutes:
        training.run(data, min(training.seconds + 120, 60 * args.minutes))
        metrics = evaluate(training.average, held_out)
        training.save(file, metrics)
        line = json.dumps({"steps": training.steps, "seconds": round(training.seconds), **metrics})
        print(line, flush=True)
        with (args.folder / "log.jsonl").open("a") as log:
            log.write(line + "\n")


if __name__ == "__main__":
    np.seterr(all="raise")
    main()
