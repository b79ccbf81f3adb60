"""Train a foreground network on rendered scenes: ``python -m models.training.foreground.train``.

Resumable and bounded by time: the learning rate follows the share of ``--minutes`` that is spent, summed
over all runs on the same checkpoint, so a run may be cut into chunks. Log and validation pictures lie
beside the checkpoint.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from models.synthesis.scenes import SceneParams, render_scene
from models.synthesis.textures import TexturePool, load_pool
from models.training.foreground.initial import unfold
from models.training.foreground.network_compact import foreground_loss
from models.training.foreground.networks import NETWORKS, ForegroundNetwork, build, stored
from models.training.foreground.stream import SceneStream
from models.training.state import take_mean

MEAN = (0.485, 0.456, 0.406)
STD = (0.229, 0.224, 0.225)
_VALIDATION_SEED = 10_000_019
_CALIBRATION_SEED = 20_000_003
_BATCHES_AHEAD = 20
"""Scenes that must be there before the first step, in batches: else the first ones are seen over and over."""


@dataclass(frozen=True)
class TrainParams:
    """``minutes`` of training in all; ``chunk`` minutes of this run; ``decay`` of the averaged weights;
    ``height`` and ``width`` of the scenes, which a later run may enlarge; ``network`` by its name, its channels
    divided by ``slim``; ``slots`` scenes are held at a time. Raises ValueError for settings under which a training
    would never begin."""

    network: str = "compact"
    slim: int = 1
    height: int = 192
    width: int = 320
    minutes: float = 100.0
    chunk: float = 1e9
    batch: int = 8
    rate: float = 1.2e-3
    encoder_rate: float = 0.4
    decay: float = 0.998
    seed: int = 1
    slots: int = 6000
    renderers: int = 1
    validate_every: float = 8.0

    def __post_init__(self) -> None:
        if self.batch < 1 or self.renderers < 1 or self.minutes <= 0:
            raise ValueError("batch, renderers and minutes must be above 0")
        needed = _BATCHES_AHEAD * self.batch + self.renderers  # each renderer may be at work on one of them
        if self.slots < needed:
            raise ValueError(f"slots is {self.slots}; with batches of {self.batch} it takes at least {needed}")


@dataclass
class Progress:
    step: int = 0
    seconds: float = 0.0
    pictures: int = 0
    best: float = 0.0


def normalize(images: Tensor) -> Tensor:
    """(B, 3, H, W) uint8 to the network's input."""
    mean, std = (torch.tensor(v, device=images.device).view(1, 3, 1, 1) for v in (MEAN, STD))
    return (images.float() / 255.0 - mean) / std


def learning_rate(share: float, peak: float) -> float:
    """Warm-up over the first 3 %, then half a cosine down to 1 % of ``peak``."""
    if share < 0.03:
        return peak * (0.05 + 0.95 * share / 0.03)
    return peak * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min((share - 0.03) / 0.97, 1.0))))


class Training:
    """Network, averaged network, optimizer and progress: what a checkpoint holds."""

    def __init__(self, params: TrainParams, folder: Path, device: torch.device) -> None:
        self.params, self.folder, self.device = params, folder, device
        torch.manual_seed(params.seed)
        self.network = build(params.network, params.slim).to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = build(params.network, params.slim).to(device).eval()
        encoder = list(self.network.features.parameters())
        known = {id(p) for p in encoder}
        decoder = [p for p in self.network.parameters() if id(p) not in known]
        self.optimizer = torch.optim.AdamW(
            [{"params": encoder, "scale": params.encoder_rate}, {"params": decoder, "scale": 1.0}],
            lr=params.rate,
            weight_decay=0.01,
        )
        self.progress = Progress()

    def start(self, pretrained: Path | None) -> None:
        """Continue from the folder's checkpoint, or begin from ``pretrained`` encoder weights.

        Raises ValueError when the checkpoint is of another network than the one asked for.
        """
        file = self.folder / "last.pt"
        if file.exists():
            state = torch.load(file, map_location=self.device, weights_only=True)
            self._check(*stored(state["params"]))
            self.network.load_state_dict(state["network"])
            self.average.load_state_dict(state["average"])
            self.optimizer.load_state_dict(state["optimizer"])
            self.progress = Progress(**state["progress"])
        elif pretrained is not None:
            taken = self.network.load_encoder(torch.load(pretrained, map_location="cpu", weights_only=True))
            self.log(event="pretrained", tensors=taken)
            self.average.load_state_dict(self.network.state_dict())

    def take(self, exported: Path, pictures: Iterable[Tensor]) -> None:
        """Begin from a network that was exported, unless the folder has a checkpoint."""
        if not (self.folder / "last.pt").exists():
            self.log(event="initial", file=exported.name, convolutions=unfold(exported, self.network, pictures))
            self.average.load_state_dict(self.network.state_dict())

    def _check(self, network: str, slim: int) -> None:
        if (network, slim) != (self.params.network, self.params.slim):
            raise ValueError(f"{self.folder} holds --network {network} --slim {slim}; ask for these or another folder")

    def save(self, name: str, metrics: dict[str, float] | None = None) -> None:
        state = {
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "progress": asdict(self.progress),
            "params": asdict(self.params),
            "metrics": metrics or {},
        }
        temporary = self.folder / f"{name}.tmp"
        torch.save(state, temporary)
        temporary.replace(self.folder / f"{name}.pt")

    def step(self, images: Tensor, masks: Tensor) -> float:
        share = self.progress.seconds / (60 * self.params.minutes)
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(share, self.params.rate) * group["scale"]
        x = normalize(images.to(self.device)).contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16):
            logits = self.network(x)
        loss = foreground_loss(logits.float(), masks.to(self.device).unsqueeze(1).float())
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimizer.step()
        self._average()
        self.progress.step += 1
        self.progress.pictures += len(images)
        return float(loss.detach())

    def _average(self) -> None:
        decay = min(self.params.decay, (1 + self.progress.step) / (10 + self.progress.step))
        take_mean(self.average, self.network, decay)

    def log(self, **fields: Any) -> None:
        line = json.dumps({k: round(v, 4) if isinstance(v, float) else v for k, v in fields.items()})
        print(line, flush=True)
        with (self.folder / "log.jsonl").open("a") as file:
            file.write(line + "\n")


class Validated(Protocol):
    """A training with averaged weights, and a folder for the pictures of its validation."""

    average: ForegroundNetwork
    device: torch.device
    folder: Path


@torch.no_grad()
def validate(training: Validated, pool: TexturePool, scenes: SceneParams, count: int = 64) -> dict[str, float]:
    """Mean Dice at 0.5 over pictures with cables, share of false pixels on pictures without; saves a sheet."""
    dice, false, sheet = [], [], []
    training.average.eval()
    for k in range(count):
        scene = render_scene(np.random.default_rng([_VALIDATION_SEED, k]), scenes, pool)
        image = (scene.rgb * 255).round().byte()[None]
        p = torch.sigmoid(training.average(normalize(image.to(training.device))))[0, 0].cpu()
        found, true = p > 0.5, scene.ids > 0
        if true.any():
            dice.append(float(2 * (found & true).sum() / (found.sum() + true.sum())))
        else:
            false.append(float(found.float().mean()))
        if k < 12:
            sheet.append(torch.cat([scene.rgb, p.expand(3, -1, -1)], 2))
    _save_sheet(sheet, training.folder / "validation.png")
    return {"dice": float(np.mean(dice)), "false": float(np.mean(false)) if false else 0.0}


def _save_sheet(tiles: list[Tensor], path: Path) -> None:
    try:
        import cv2
    except ImportError:  # a training machine may have torch and numpy alone
        return
    rows = [torch.cat(tiles[i : i + 3], 2) for i in range(0, len(tiles) - 2, 3)]
    image = (torch.cat(rows, 1).clamp(0, 1) * 255).byte().permute(1, 2, 0).numpy()
    cv2.imwrite(str(path), image[:, :, ::-1])


def train(
    params: TrainParams,
    scenes: SceneParams,
    pool: TexturePool,
    folder: Path,
    pretrained: Path | None = None,
    initial: Path | None = None,
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    training = Training(params, folder, device)
    training.start(pretrained)
    if initial is not None:
        training.take(initial, _calibration(scenes, pool))
    stream = SceneStream(
        scenes,
        pool,
        seed=params.seed + 1000 * training.progress.step,
        slots=params.slots,
        renderers=params.renderers,
    )
    try:
        _loop(training, stream, pool, scenes)
    finally:
        stream.close()


def _calibration(scenes: SceneParams, pool: TexturePool, batches: int = 12) -> Iterator[Tensor]:
    for k in range(batches):
        numbers = range(4 * k, 4 * k + 4)
        rgb = [render_scene(np.random.default_rng([_CALIBRATION_SEED, n]), scenes, pool).rgb for n in numbers]
        yield normalize((torch.stack(rgb) * 255).round().byte())


def _loop(training: Training, stream: SceneStream, pool: TexturePool, scenes: SceneParams) -> None:
    params, progress = training.params, training.progress
    rng = np.random.default_rng([params.seed, progress.step])
    while stream.filled() < _BATCHES_AHEAD * params.batch:
        time.sleep(0.5)
    run_end = progress.seconds + 60 * params.chunk
    validated, losses, last = progress.seconds, [], time.monotonic()
    training.network.train()
    while progress.seconds < min(60 * params.minutes, run_end):
        losses.append(training.step(*stream.batch(rng, params.batch)))
        now = time.monotonic()
        progress.seconds += now - last
        last = now
        if progress.seconds - validated > 60 * params.validate_every:
            _checkpoint(training, pool, scenes, stream, losses)
            validated, losses, last = progress.seconds, [], time.monotonic()
    _checkpoint(training, pool, scenes, stream, losses)


def _checkpoint(
    training: Training, pool: TexturePool, scenes: SceneParams, stream: SceneStream, losses: list[float]
) -> None:
    metrics = validate(training, pool, scenes)
    training.log(
        **asdict(training.progress),
        loss=float(np.mean(losses or [0.0])),
        rendered=stream.rendered.value,
        **metrics,
    )
    training.save("last", metrics)
    if metrics["dice"] > training.progress.best:
        training.progress.best = metrics["dice"]
        training.save("best", metrics)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m models.training.foreground.train", description=__doc__)
    parser.add_argument("folder", type=Path, help="checkpoint folder; continues from last.pt when it is there")
    parser.add_argument("--textures", type=Path, help="pack or folder of backgrounds")
    parser.add_argument("--pretrained", type=Path, help="published ImageNet weights of the encoder to begin from")
    parser.add_argument("--initial", type=Path, help="exported network of the same kind to begin from")
    parser.add_argument("--threads", type=int, default=1)
    for name, default in asdict(TrainParams()).items():
        choices = list(NETWORKS) if name == "network" else None
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default, choices=choices)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    try:
        params = TrainParams(**{name: getattr(args, name) for name in asdict(TrainParams())})
    except ValueError as error:
        parser.error(str(error))
    scenes = SceneParams((args.height, args.width))
    train(params, scenes, load_pool(args.textures), args.folder, args.pretrained, args.initial)


if __name__ == "__main__":
    main()
