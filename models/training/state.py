"""The state of a training, in memory and on disk, so that a second start goes on from it."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

T = TypeVar("T")
_MAY_CHANGE = ("epochs", "minutes")
"""Settings that a second start may give otherwise: a training can be made longer."""


@dataclass(frozen=True)
class Config:
    """How a network is trained. A family adds its own settings.

    ``epochs`` or, where they are above 0, ``minutes`` of processor time, summed over all starts,
    end the training. ``rate``: the learning rate at its highest, reached after the share
    ``warm_up`` of the training and held for the share ``hold``; ``clip``: largest norm of the
    gradient, 0 for any; ``keep``: how much of the running mean of the weights a step leaves, 0 for
    no mean. Raises ValueError for settings under which a training would never end or never begin.
    """

    seed: int = 1
    epochs: int = 10
    minutes: float = 0.0
    batch: int = 64
    rate: float = 2e-3
    warm_up: float = 0.0
    hold: float = 0.0
    weight_decay: float = 0.01
    clip: float = 0.0
    keep: float = 0.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{name} is {value}, not a finite number")
        if self.minutes < 0 or (self.minutes == 0 and self.epochs < 1):
            raise ValueError(
                "epochs is less than 1 and there are no minutes: there is nothing to train for"
            )
        if self.batch < 1:
            raise ValueError(f"batch is {self.batch}; a step needs at least one sample")
        if self.rate <= 0:
            raise ValueError(f"rate is {self.rate}; with it no weight changes")
        if not (0 <= self.warm_up < 1 and 0 <= self.keep < 1 and 0 <= self.hold < 1 - self.warm_up):
            raise ValueError(
                "warm_up, hold and keep are shares, at least 0 and less than 1, the first two together"
            )


def rate_at(share: float, warm_up: float, hold: float = 0.0) -> float:
    """Share of the highest learning rate when ``share`` of a training is done: a straight rise from
    5 % over the first ``warm_up``, all of it for ``hold``, then half a cosine down to 1 %."""
    if share < warm_up:
        return 0.05 + 0.95 * share / warm_up
    flat = warm_up + hold
    fallen = min(max(share - flat, 0.0) / (1 - flat), 1.0)
    return 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * fallen))


class Course:
    """All that a step changes: network, running mean of its weights, optimizer, and how far it has
    come.

    ``groups``: parameters with a ``scale`` of the learning rate each; None: all alike.
    """

    def __init__(
        self, network: nn.Module, config: Config, groups: list[dict[str, Any]] | None = None
    ) -> None:
        self.config, self.network = config, network
        self.average = copy.deepcopy(network).requires_grad_(False) if config.keep else network
        parameters = groups or [{"params": list(network.parameters())}]
        self.optimizer = torch.optim.AdamW(
            parameters, lr=config.rate, weight_decay=config.weight_decay
        )
        self.epochs, self.steps, self.seconds = 0, 0, 0.0

    def share(self, of_epoch: float = 0.0) -> float:
        """How much of the training is done, 0 to 1; ``of_epoch``: how much of the running epoch."""
        if self.config.minutes:
            return min(self.seconds / (60 * self.config.minutes), 1.0)
        return min((self.epochs + of_epoch) / self.config.epochs, 1.0)

    def step(self, loss: Tensor, of_epoch: float = 0.0) -> float:
        """One step down the gradient of a loss; returns the loss as a number."""
        rate = self.config.rate * rate_at(
            self.share(of_epoch), self.config.warm_up, self.config.hold
        )
        for group in self.optimizer.param_groups:
            group["lr"] = rate * group.get("scale", 1.0)
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        if self.config.clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip)
        self.optimizer.step()
        self.steps += 1
        if self.config.keep:
            take_mean(
                self.average, self.network, min(self.config.keep, self.steps / (10 + self.steps))
            )
        return float(loss.detach())

    def result(self) -> nn.Module:
        """The network to use, in evaluation mode: the running mean where there is one."""
        return self.average.eval()

    def save(self, file: Path, **more: Any) -> None:
        """Write the state, and what else belongs beside it; the file is never half written."""
        file.parent.mkdir(parents=True, exist_ok=True)
        progress = {"epochs": self.epochs, "steps": self.steps, "seconds": self.seconds}
        states = {
            name: getattr(self, name).state_dict() for name in ("network", "average", "optimizer")
        }
        partial = file.with_suffix(".part")
        torch.save({"config": asdict(self.config), "progress": progress, **states, **more}, partial)
        partial.replace(file)

    def restore(
        self, file: Path, check: Callable[[Mapping[str, Any]], None] = lambda _: None
    ) -> Mapping[str, Any] | None:
        """Go on from ``file``; what it holds, or None where there is no such file. Raises
        ValueError when it was begun with other settings, and what ``check`` raises of what it
        holds."""
        if not file.exists():
            return None
        state: Mapping[str, Any] = torch.load(file, map_location="cpu", weights_only=True)
        check(state)
        for name, value in asdict(self.config).items():
            if name not in _MAY_CHANGE and state["config"].get(name) != value:
                begun = state["config"].get(name)
                raise ValueError(
                    f"{file} was begun with {name} {begun}, not {value}: take another folder"
                )
        for name in ("network", "average", "optimizer"):
            getattr(self, name).load_state_dict(state[name])
        self.epochs, self.steps, self.seconds = (
            state["progress"][k] for k in ("epochs", "steps", "seconds")
        )
        return state


@torch.no_grad()
def take_mean(average: nn.Module, network: nn.Module, keep: float) -> None:
    """Move the weights of ``average`` to those of ``network``, but for the share ``keep``; counters
    are copied."""
    for mean, new in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mean.dtype.is_floating_point:
            mean.lerp_(new, 1 - keep)
        else:
            mean.copy_(new)


def kept(file: Path, make: Callable[[], T]) -> T:
    """What ``make`` gives, from ``file`` when it was made before."""
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".part")
        partial.write_bytes(pickle.dumps(make()))
        partial.replace(file)
    made: T = pickle.loads(file.read_bytes())
    return made
