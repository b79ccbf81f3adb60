"""One loop trains every network; a network is a :class:`Family`, a row of the table in
``families.py``.

Strategy: a family brings its samples, its network, a loss over rows of the samples and a measure.
The loop brings the rest: shuffled batches, a learning rate that follows the share of the training
that is done, the running mean of the weights, a state after every epoch from which a second start
goes on, and a line of the log. The randomness of an epoch follows from the seed and the epoch's
number, so a training that was stopped ends in the very network of one that was not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import IntArray
from models.training.export import Exported
from models.training.log import Log
from models.training.state import Config, Course

C = TypeVar("C", bound=Config)
D = TypeVar("D", bound=Sized)


@dataclass(frozen=True)
class Source:
    """Where samples come from: ``folder`` keeps what was made once; ``textures``: background
    pictures, without them they are noise; ``data`` and ``watched``: folders or files of samples
    that another command made, to learn from and to measure on."""

    folder: Path
    textures: Path | None = None
    data: Path | None = None
    watched: Path | None = None


def as_they_are(samples: D, config: Config, rng: np.random.Generator) -> D:
    """The samples of an epoch where every epoch has the same."""
    return samples


@dataclass(frozen=True)
class Family(Generic[C, D]):
    """A network that can be trained.

    ``config``: its settings, defaults are those of the shipped network; ``samples``: those for
    training and those held out; ``build``: the network with random weights; ``epoch``: the samples
    of one epoch; ``loss``: of some rows of them; ``measure``: figures of the held-out samples;
    ``without``: the same figures by a ``rule`` that would stand in for the network; ``exports``:
    the files to write; ``least``: figures that a network has to exceed to be exported; ``needs``:
    fields of :class:`Source` that must be given.
    """

    name: str
    config: type[C]
    samples: Callable[[C, Source], tuple[D, D]]
    build: Callable[[C, D], nn.Module]
    loss: Callable[[nn.Module, D, IntArray, np.random.Generator, C], Tensor]
    measure: Callable[[nn.Module, D, C], dict[str, float]]
    without: Callable[[D, C], Mapping[str, Any]]
    exports: Callable[[nn.Module, D, C], Sequence[Exported]]
    least: Mapping[str, float]
    epoch: Callable[[D, C, np.random.Generator], D] = field(default=as_they_are)
    needs: tuple[str, ...] = ()


def fit(
    family: Family[C, D], config: C, samples: D, state: Path, log: Log | None = None
) -> nn.Module:
    """The trained network, in evaluation mode. ``state``: the file to go on from, written after
    every epoch.

    Raises ValueError where there are no samples or the state was begun with other settings.
    """
    if not len(samples):
        raise ValueError(f"{family.name}: no samples to learn from")
    torch.manual_seed(config.seed)
    course = Course(family.build(config, samples), config)
    course.restore(state)
    while course.share() < 1:
        loss = _epoch(family, course, config, samples)
        course.save(state)
        if log is not None:
            log(
                network=family.name,
                epoch=course.epochs,
                steps=course.steps,
                seconds=course.seconds,
                loss=loss,
            )
    return course.result()


def _epoch(family: Family[C, D], course: Course, config: C, samples: D) -> float:
    """Every sample once, or as many as the time allows; returns the mean loss of the last
    quarter."""
    rng = np.random.default_rng([config.seed, course.epochs])
    torch.manual_seed(config.seed + course.epochs)  # of dropout
    drawn = family.epoch(samples, config, rng)
    # Batches of nearly one size: a last one of a sample or two would upset the normalization
    # layers.
    batches = np.array_split(rng.permutation(len(drawn)), max(round(len(drawn) / config.batch), 1))
    course.network.train()
    losses: list[float] = []
    for k, rows in enumerate(batches):
        done = k / len(batches)
        if course.share(done) >= 1:
            break
        started = time.process_time()
        losses.append(course.step(family.loss(course.network, drawn, rows, rng, config), done))
        course.seconds += time.process_time() - started
    course.epochs += 1
    return float(np.mean(losses[-max(len(losses) // 4, 1) :]))


AnyFamily = Family[Any, Any]
