"""How a foreground network learns from pictures and labels: the loss, a step, and where it
begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from models.training.foreground.augmentation import UNKNOWN
from models.training.foreground.hints import Hints
from models.training.foreground.initial import unfold
from models.training.foreground.network_deeplab import DeepLab
from models.training.foreground.networks import ForegroundNetwork, build, stored
from models.training.foreground.teacher import Teacher, taught_loss
from models.training.state import Config, Course

MEAN = (0.485, 0.456, 0.406)
STD = (0.229, 0.224, 0.225)


def normalize(images: Tensor) -> Tensor:
    """(B, 3, H, W) uint8 to the network's input."""
    mean, std = (torch.tensor(v, device=images.device).view(1, 3, 1, 1) for v in (MEAN, STD))
    return (images.float() / 255.0 - mean) / std


def foreground_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Binary cross entropy and soft Dice per picture, over the pixels where one can tell.

    ``logits`` (B, 1, H, W); ``labels`` (B, H, W) 255 cable, 0 none, 128 cannot tell. A picture
    without cables has no Dice term: there the cross entropy alone pushes everything down.
    """
    target = (labels == 255).float().unsqueeze(1)
    weight = (labels != UNKNOWN).float().unsqueeze(1)
    bce = (
        F.binary_cross_entropy_with_logits(logits, target, reduction="none") * weight
    ).sum() / weight.sum().clamp(min=1)
    p = torch.sigmoid(logits) * weight
    both, total = (p * target).sum((1, 2, 3)), (p + target).sum((1, 2, 3))
    filled = (target.sum((1, 2, 3)) > 0).float()
    dice = (1 - (2 * both + 1) / (total + 1)) * filled
    return bce + dice.sum() / filled.sum().clamp(min=1)


def hinted_loss(
    network: DeepLab, images: Tensor, labels: Tensor, hints: Hints, weight: float
) -> Tensor:
    """That of a batch as :func:`loss_of` takes it, taught by what a teacher answers and, with so
    much ``weight``, by what its encoder sees."""
    x = _input(network, images)
    with torch.autocast(x.device.type, torch.bfloat16):
        shown = hints.shown(x)
        low, high = network.features(x)
        logits = network.decoded(low, high)
        unexplained = hints(shown, low, high)
    return _taught(logits.float(), labels.to(x.device), shown.probability) + weight * unexplained


def loss_of(
    network: nn.Module, images: Tensor, labels: Tensor, teacher: Teacher | None = None
) -> Tensor:
    """That of a batch: (B, 3, H, W) uint8 pictures and (B, H, W) uint8 labels; with a teacher, the
    mean of its loss and that of the labels."""
    x = _input(network, images)
    with torch.autocast(x.device.type, torch.bfloat16):
        logits = network(x)
    if teacher is None:
        return foreground_loss(logits.float(), labels.to(x.device))
    return _taught(logits.float(), labels.to(x.device), teacher(images).to(x.device))


def _input(network: nn.Module, images: Tensor) -> Tensor:
    """(B, 3, H, W) uint8 pictures as a network takes them, where it is."""
    device = next(network.parameters()).device
    return normalize(images.to(device)).contiguous(memory_format=torch.channels_last)


def _taught(logits: Tensor, labels: Tensor, seen: Tensor) -> Tensor:
    """The mean of the labels' loss and that of what a teacher has ``seen`` (B, H, W)."""
    return (foreground_loss(logits, labels) + taught_loss(logits, labels, seen)) / 2


class Learning:
    """A foreground network on its course, on the GPU where there is one."""

    def __init__(
        self,
        network: str,
        slim: int,
        config: Config,
        encoder_rate: float = 1.0,
        teacher: Teacher | None = None,
        hints: str = "",
    ) -> None:
        """``network`` by its name, its channels divided by ``slim``; the encoder learns at
        ``encoder_rate`` times the rate. ``hints``: a compact network of the manifest as a teacher
        that shows what its encoder sees, too."""
        self.teacher = teacher
        torch.manual_seed(config.seed)
        self.name, self.slim = network, slim
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        built = build(network, slim).to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        encoder = list(built.features.parameters())
        known = {id(p) for p in encoder}
        decoder = [p for p in built.parameters() if id(p) not in known]
        self.hints = Hints(hints, built).to(self.device) if hints else None
        decoder += self.hints.parameters() if self.hints else []
        self.course = Course(
            built, config, [{"params": encoder, "scale": encoder_rate}, {"params": decoder}]
        )

    @property
    def network(self) -> ForegroundNetwork:
        return self.course.network  # type: ignore[return-value]

    @property
    def average(self) -> ForegroundNetwork:
        """That of the averaged weights, in evaluation mode."""
        return self.course.result()  # type: ignore[return-value]

    def step(self, images: Tensor, labels: Tensor) -> float:
        """One step on a batch, as :func:`loss_of` takes it; returns the loss."""
        if self.hints is None:
            return self.course.step(loss_of(self.network, images, labels, self.teacher))
        weight = 1 - self.course.share()  # in the end only what is answered counts
        return self.course.step(hinted_loss(self.network, images, labels, self.hints, weight))  # type: ignore[arg-type]

    def resume(self, file: Path) -> bool:
        """Go on from a checkpoint; False where there is none. Raises ValueError when it is of
        another network or was begun with other settings."""

        def check(state: Mapping[str, Any]) -> None:
            name, slim = stored(state["params"])
            if (name, slim) != (self.name, self.slim):
                raise ValueError(
                    f"{file.parent} holds --network {name} --slim {slim}; ask for these or another folder"
                )
            if ("hints" in state) != (self.hints is not None):
                raise ValueError(
                    f"{file.parent} was begun {'with' if 'hints' in state else 'without'} --hints"
                )

        state = self.course.restore(file, check)
        if state and self.hints is not None:
            self.hints.load_state_dict(state["hints"])
        return state is not None

    def begin(
        self, pretrained: Path | None, exported: Path | None, pictures: Iterable[Tensor]
    ) -> None:
        """From published weights of the encoder, or from an exported network of the same kind,
        whose normalizations take their statistics from ``pictures``, normalized, or from another
        checkpoint of it (``.pt``)."""
        if pretrained is not None:
            self.network.load_encoder(torch.load(pretrained, map_location="cpu", weights_only=True))
        if exported is not None and exported.suffix == ".pt":
            self.network.load_state_dict(
                torch.load(exported, map_location="cpu", weights_only=True)["average"]
            )
        elif exported is not None:
            unfold(exported, self.network, pictures)
        self.course.average.load_state_dict(self.network.state_dict())

    def save(self, file: Path, params: Mapping[str, Any], **more: Any) -> None:
        """A checkpoint that can be resumed and exported; ``params``: all settings of the
        training."""
        hints = {} if self.hints is None else {"hints": self.hints.state_dict()}
        self.course.save(
            file, params={**params, "network": self.name, "slim": self.slim}, **hints, **more
        )
