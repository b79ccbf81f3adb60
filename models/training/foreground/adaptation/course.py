"""The learning itself: a few hundred steps from a network that is already good.

Strategy: normalizations keep their statistics and the first stages their weights, for what edges
and textures look like is the same everywhere; so a step costs half, and less is forgotten. The
running mean of the weights counts.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from models.training.foreground.adaptation.sources import Batches
from models.training.foreground.initial import unfold
from models.training.foreground.learning import loss_of
from models.training.foreground.networks import build
from models.training.state import Config, Course

_KEPT_STAGES = {"compact": 4, "dense": 2, "dense_large": 2}
"""Stages of the encoder, from the picture on to a quarter of its size, that stay as they are."""


@dataclass(frozen=True)
class CourseParams:
    """``minutes`` by the clock, over all runs on one checkpoint; ``real`` share of the place's own
    pictures in a ``batch``; ``rate`` at its highest; ``decay`` of the running mean; ``renders`` to
    rehearse with, ``general`` ones to measure on."""

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

    def config(self) -> Config:
        """How the network learns."""
        return Config(
            seed=self.seed,
            minutes=self.minutes,
            batch=self.batch,
            rate=self.rate,
            keep=self.decay,
            weight_decay=0.0,
            clip=5.0,
            warm_up=0.05,
            hold=0.45,
        )


def begun(name: str, parent: Path, params: CourseParams) -> Course:
    """The course of an exported network ``parent`` of the architecture ``name``."""
    torch.manual_seed(params.seed)
    network = build(name).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    unfold(parent, network)
    network.eval()
    _keep(network, _KEPT_STAGES.get(name, 0))
    learns = [p for p in network.parameters() if p.requires_grad]
    return Course(network, params.config(), [{"params": learns}])


def step(course: Course, batches: Batches) -> float:
    """One batch; returns its loss."""
    started = time.monotonic()
    loss = course.step(loss_of(course.network, *batches.draw(course.config.batch)))
    course.seconds += time.monotonic() - started
    return loss


def _keep(network: nn.Module, stages: int) -> None:
    features = network.features
    assert isinstance(features, nn.ModuleList)
    for stage in features[:stages]:
        stage.requires_grad_(False)
