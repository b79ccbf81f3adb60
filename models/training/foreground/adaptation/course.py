"""The learning itself: a few hundred steps from a network that is already good.

Strategy: normalizations keep their statistics and the first stages their weights, for what edges and textures look
like is the same everywhere; so a step costs half, and less is forgotten. The running mean of the weights counts.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from models.training.foreground.adaptation.sources import Batches
from models.training.foreground.campaign import descend
from models.training.foreground.initial import unfold
from models.training.foreground.networks import build
from models.training.state import take_mean

_KEPT_STAGES = {"compact": 4, "dense": 2, "dense_large": 2}
"""Stages of the encoder, from the picture on to a quarter of its size, that stay as they are."""


@dataclass(frozen=True)
class CourseParams:
    """``minutes`` by the clock, over all runs on one checkpoint; ``real`` share of the place's own pictures in a
    ``batch``; ``rate`` at its highest; ``decay`` of the running mean; ``renders`` to rehearse with, ``general`` ones to
    measure on."""

    minutes: float = 8.0
    height: int = 256
    width: int = 448
    batch: int = 8
    real: float = 0.4
    rate: float = 3e-4
    decay: float = 0.98
    renders: int = 160
    general: int = 32
    seed: int = 1


class Course:
    """Network, its running mean, optimizer, and how far they have come."""

    def __init__(self, name: str, parent: Path, params: CourseParams) -> None:
        """``name`` of the architecture of the exported network ``parent``."""
        torch.manual_seed(params.seed)
        self.params = params
        self.network = build(name).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        unfold(parent, self.network)
        self.average = build(name).eval()
        self.average.load_state_dict(self.network.state_dict())
        self.network.eval()
        _keep(self.network, _KEPT_STAGES.get(name, 0))
        learning = [p for p in self.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(learning, lr=params.rate, weight_decay=0.0)
        self.steps, self.seconds = 0, 0.0

    @property
    def share(self) -> float:
        """Of the time that is over."""
        return min(self.seconds / (60 * self.params.minutes), 1.0)

    def step(self, batches: Batches) -> float:
        """One batch; returns its loss."""
        started = time.monotonic()
        images, labels = batches.draw(self.params.batch)
        for group in self.optimizer.param_groups:
            group["lr"] = self.params.rate * rate_share(self.share)
        loss = descend(self.network, self.optimizer, images, labels)
        self.steps += 1
        take_mean(self.average, self.network, min(self.params.decay, (1 + self.steps) / (10 + self.steps)))
        self.seconds += time.monotonic() - started
        return loss

    def save(self, file: Path) -> None:
        """The file is never half written."""
        states = {name: getattr(self, name).state_dict() for name in ("network", "average", "optimizer")}
        torch.save({**states, "steps": self.steps, "seconds": self.seconds}, file.with_suffix(".part"))
        file.with_suffix(".part").replace(file)

    def resume(self, file: Path) -> None:
        """Go on from ``file`` where there is one."""
        if not file.exists():
            return
        state = torch.load(file, map_location="cpu", weights_only=True)
        for name in ("network", "average", "optimizer"):
            getattr(self, name).load_state_dict(state[name])
        self.steps, self.seconds = state["steps"], state["seconds"]


def rate_share(share: float) -> float:
    """Share of the highest rate: a warm-up over the first twentieth of the time, flat, a fall over the last half."""
    return float(max(min(share / 0.05 + 0.05, 1.0, (1 - share) / 0.5), 0.02))


def _keep(network: nn.Module, stages: int) -> None:
    features = network.features
    assert isinstance(features, nn.ModuleList)
    for stage in features[:stages]:
        stage.requires_grad_(False)
