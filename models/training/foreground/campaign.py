"""Train a foreground network on renders and photographs: ``python -m models.training.foreground.campaign``.

Every batch mixes scenes of the renderer, cuts of hand-marked photographs at any scale and photographs without
cables. Pixels where nobody can tell have no weight. The learning rate warms up, holds, and falls over the last
third of ``--minutes``: the averaged weights at the end are what is exported; a later run goes on from them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from models.synthesis.scenes import WORKSHOP, SceneParams
from models.synthesis.textures import load_pool
from models.training.foreground.augmentation import UNKNOWN, Cut, cut_out, recolored
from models.training.foreground.initial import unfold
from models.training.foreground.networks import build
from models.training.foreground.real_pictures import RealPictures, load_empty, load_labelled
from models.training.foreground.stream import SceneStream
from models.training.foreground.train import normalize, validate
from models.training.state import take_mean

_DATA = (
    "models.synthesis scenes over permissively licensed textures and photographs, and hand-marked photographs of open "
    "hardware projects (NOTICE names them)"
)
_CALIBRATION_BATCHES = 12
"""From which the statistics of a network that begins from an export are taken."""


@dataclass(frozen=True)
class CampaignParams:
    """``minutes`` of training by the clock; ``batch`` cuts a step of which ``labelled`` are of marked photographs
    and ``empty`` of photographs without cables, on average; ``rate`` at its highest; ``decay`` of the averaged weights;
    every render is drawn ``reuse`` times, each time cut anew. ``plain`` is the share of the renders that lie on a table
    as in a laboratory, none of them in the air."""

    network: str = "dense"
    height: int = 256
    width: int = 448
    minutes: float = 130.0
    batch: int = 8
    labelled: float = 1.7
    empty: float = 0.6
    plain: float = 0.0
    rate: float = 1.5e-3
    decay: float = 0.999
    seed: int = 1
    slots: int = 2400
    reuse: int = 4
    check_every: float = 10.0


class Streams(NamedTuple):
    """Renders: of ``workshop`` scenes, and ``plain`` ones of a table (the same stream when none are wanted)."""

    workshop: SceneStream
    plain: SceneStream

    def filled(self) -> int:
        return min(stream.filled() for stream in self)

    def rendered(self) -> int:
        return sum(stream.rendered.value for stream in set(self))

    def close(self) -> None:
        for stream in set(self):
            stream.close()


class Mixture:
    """Batches of renders of two kinds, labelled photographs and photographs without cables."""

    def __init__(self, streams: Streams, real: RealPictures, empty: RealPictures, params: CampaignParams) -> None:
        self.streams, self.real, self.empty, self.params = streams, real, empty, params
        self.rng = np.random.default_rng([params.seed, time.time_ns() % 2**32])
        size = params.height, params.width
        self.near = Cut(size, (0.3, 1.3), 0.25)
        self.rendered = Cut(size, (0.7, 1.5), 0.3)

    def batch(self) -> tuple[Tensor, Tensor]:
        """(B, 3, H, W) uint8 pictures and (B, H, W) uint8 labels."""
        pairs = [self._one() for _ in range(self.params.batch)]
        images = np.stack([recolored(image, self.rng).transpose(2, 0, 1) for image, _ in pairs])
        return torch.from_numpy(images), torch.from_numpy(np.stack([labels for _, labels in pairs]))

    def _one(self) -> tuple[np.ndarray, np.ndarray]:
        kind = self.rng.random() * self.params.batch
        if kind < self.params.labelled:
            return self.real.sample(self.rng, self.near)
        if kind < self.params.labelled + self.params.empty:
            return self.empty.sample(self.rng, self.near)
        stream = self.streams.plain if self.rng.random() < self.params.plain else self.streams.workshop
        images, masks = stream.draw(self.rng, 1)
        image = np.ascontiguousarray(images[0].numpy().transpose(1, 2, 0))
        labels = masks[0].numpy() * 255
        if self.rng.random() < 0.3:  # as rendered, sharp to the pixel
            return image, labels
        return cut_out(image, labels, self.rendered, self.rng)


def masked_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Binary cross entropy and soft Dice over the pixels where one can tell; ``labels`` (B, H, W) 255, 128, 0."""
    target = (labels == 255).float().unsqueeze(1)
    weight = (labels != UNKNOWN).float().unsqueeze(1)
    bce = (F.binary_cross_entropy_with_logits(logits, target, reduction="none") * weight).sum() / weight.sum().clamp(
        min=1
    )
    p = torch.sigmoid(logits) * weight
    both, total = (p * target).sum((1, 2, 3)), (p + target).sum((1, 2, 3))
    filled = (target.sum((1, 2, 3)) > 0).float()
    dice = (1 - (2 * both + 1) / (total + 1)) * filled
    return bce + dice.sum() / filled.sum().clamp(min=1)


def descend(network: torch.nn.Module, optimizer: torch.optim.Optimizer, images: Tensor, labels: Tensor) -> float:
    """One step of the optimizer on a batch as :meth:`Mixture.batch` gives it; returns the loss."""
    x = normalize(images).contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16):
        logits = network(x)
    loss = masked_loss(logits.float(), labels)
    optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    optimizer.step()
    return float(loss.detach())


class Campaign:
    """Network, its averaged copy, optimizer and how far it has come."""

    def __init__(self, params: CampaignParams, folder: Path) -> None:
        self.params, self.folder, self.device = params, folder, torch.device("cpu")
        torch.manual_seed(params.seed)
        self.network = build(params.network).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = build(params.network).eval()
        self.average.load_state_dict(self.network.state_dict())
        self.optimizer = torch.optim.AdamW(self.network.parameters(), lr=params.rate, weight_decay=0.02)
        self.step, self.pictures, self.seconds = 0, 0, 0.0
        self.metrics: dict[str, float] = {}
        if (folder / "last.pt").exists():
            self._resume(torch.load(folder / "last.pt", map_location="cpu", weights_only=True))

    def _resume(self, state: dict[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self.average.load_state_dict(state["average"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.pictures, self.seconds = (state["progress"][k] for k in ("step", "pictures", "seconds"))

    def take(self, exported: Path, mixture: Mixture) -> None:
        """Begin from an exported network of the same kind, unless the folder has a checkpoint."""
        if self.step == 0:
            unfold(exported, self.network, (normalize(mixture.batch()[0]) for _ in range(_CALIBRATION_BATCHES)))
            self.average.load_state_dict(self.network.state_dict())

    def save(self) -> None:
        state = {
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "progress": {"step": self.step, "pictures": self.pictures, "seconds": self.seconds},
            "params": asdict(self.params),
            "metrics": self.metrics,
            "command": "python -m models.training.foreground.campaign",
            "data": _DATA,
        }
        torch.save(state, self.folder / "last.tmp")
        (self.folder / "last.tmp").replace(self.folder / "last.pt")

    def train_step(self, images: Tensor, labels: Tensor) -> float:
        for group in self.optimizer.param_groups:
            group["lr"] = self.params.rate * rate_share(self.step, self.seconds / (60 * self.params.minutes))
        loss = descend(self.network, self.optimizer, images, labels)
        self.step += 1
        self.pictures += len(images)
        self._average()
        return loss

    def _average(self) -> None:
        decay = min(self.params.decay, (1 + self.step) / (10 + self.step))
        take_mean(self.average, self.network, decay)


def rate_share(step: int, share: float) -> float:
    """Share of the highest rate: a warm-up of 300 steps, flat, then a straight fall over the last third."""
    return min((step + 1) / 300, 1.0) * float(np.clip((1 - share) / 0.35, 0.01, 1.0))


def run(
    params: CampaignParams,
    mixture: Mixture,
    folder: Path,
    measure: Callable[[Campaign], dict[str, float]],
    initial: Path | None = None,
) -> None:
    """Train until ``minutes`` are over, a checkpoint and a line of ``log.jsonl`` every ``check_every``; at the end the
    checkpoint gets what ``measure`` finds."""
    campaign = Campaign(params, folder)
    while mixture.streams.filled() < min(200, params.slots // 2):
        time.sleep(0.5)
    if initial is not None:
        campaign.take(initial, mixture)
    losses: list[float] = []
    checked, last = campaign.seconds, time.monotonic()
    campaign.network.train()
    while campaign.seconds < 60 * params.minutes:
        losses.append(campaign.train_step(*mixture.batch()))
        now = time.monotonic()
        campaign.seconds += now - last
        last = now
        if campaign.seconds - checked > 60 * params.check_every:
            checked = campaign.seconds
            _check(campaign, mixture, losses)
            losses = []
    campaign.metrics = measure(campaign)
    _check(campaign, mixture, losses)


def _check(campaign: Campaign, mixture: Mixture, losses: list[float]) -> None:
    campaign.save()
    line = {
        "step": campaign.step,
        "pictures": campaign.pictures,
        "minutes": round(campaign.seconds / 60, 1),
        "loss": round(float(np.mean(losses or [0.0])), 4),
        "rendered": mixture.streams.rendered(),
        **campaign.metrics,
    }
    print(json.dumps(line), flush=True)
    with (campaign.folder / "log.jsonl").open("a") as file:
        file.write(json.dumps(line) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m models.training.foreground.campaign", description=__doc__)
    parser.add_argument("folder", type=Path, help="checkpoint folder; goes on from last.pt when it is there")
    parser.add_argument("--textures", type=Path, required=True, help="pack or folder of backgrounds")
    parser.add_argument("--labelled", dest="photographs", type=Path, required=True, help="folder with imgs/ and masks/")
    parser.add_argument("--validate", type=int, default=64, help="rendered pictures to measure on at the end")
    parser.add_argument("--initial", type=Path, help="exported network of the same kind to begin from")
    parser.add_argument("--empty-pictures", type=Path, required=True, help="folder of photographs without cables")
    for name, default in asdict(CampaignParams()).items():
        flag = {"labelled": "labelled-share", "empty": "empty-share"}.get(name, name.replace("_", "-"))
        parser.add_argument(f"--{flag}", dest=name, type=type(default), default=default)
    args = parser.parse_args()
    torch.set_num_threads(1)
    params = CampaignParams(**{name: getattr(args, name) for name in asdict(CampaignParams())})
    args.folder.mkdir(parents=True, exist_ok=True)
    size = params.height, params.width
    scenes = replace(WORKSHOP, size=size)
    seed, pool = int(time.time()), load_pool(args.textures)
    workshop = SceneStream(scenes, pool, seed=seed, slots=params.slots, renderers=1, reuse=params.reuse)
    plain = workshop
    if params.plain:
        table = SceneParams(size, width_share=(0.006, 0.12))
        plain = SceneStream(table, pool, seed=seed + 1, slots=params.slots, renderers=1, reuse=params.reuse)
    streams = Streams(workshop, plain)
    try:
        photographs, empty = load_labelled(args.photographs), load_empty(args.empty_pictures)
        mixture = Mixture(streams, photographs, empty, params)
        run(
            params, mixture, args.folder, lambda campaign: validate(campaign, pool, scenes, args.validate), args.initial
        )
    finally:
        streams.close()


if __name__ == "__main__":
    main()
