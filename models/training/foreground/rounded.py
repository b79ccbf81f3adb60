"""Let a shipped foreground network learn to compute in 8 bits: ``python -m
models.training.foreground.rounded FOLDER``.

Quantization-aware fine-tuning (Jacob et al. 2018): in every step weights and activations are
rounded as the 8-bit network will round them, gradients go straight through, and what is learned is
to see what the network sees without rounding. Writes ``rounded.onnx`` into the folder, which
``python -m models.training.foreground.int8 --learned`` takes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.nn.utils import parametrize

from models.synthesis.textures import load_pool
from models.training.foreground.campaign import CampaignParams, mixed, picture_arguments
from models.training.foreground.initial import refold, unfold
from models.training.foreground.learning import normalize
from models.training.foreground.network_compact import InvertedResidual
from models.training.foreground.networks import build
from models.training.state import Config, Course
from models.weights.inference import WEIGHTS, spec_of

_WEIGHT_STEPS, _ACTIVATION_STEPS = 127, 255
_KEPT_RANGE = 0.99
"""Of the moving mean of an activation's range, a step."""


class RoundedWeights(nn.Module):
    """(O, I, h, w) weights as signed 8 bits, each output channel on a scale of its own."""

    def forward(self, weights: Tensor) -> Tensor:
        scale = weights.abs().amax((1, 2, 3), keepdim=True).clamp(min=1e-8) / _WEIGHT_STEPS
        return weights + ((weights / scale).round() * scale - weights).detach()


class RoundedActivations(nn.Module):
    """Activations as unsigned 8 bits over the mean range of what came so far; beyond it they are
    cut."""

    low: Tensor
    high: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("low", torch.tensor(torch.nan))
        self.register_buffer("high", torch.tensor(torch.nan))

    def forward(self, x: Tensor) -> Tensor:
        self._widen(x.detach())
        scale = ((self.high - self.low) / _ACTIVATION_STEPS).clamp(min=1e-8)
        zero = (-self.low / scale).round()
        cut = torch.minimum(torch.maximum(x, -zero * scale), (_ACTIVATION_STEPS - zero) * scale)
        return cut + ((cut / scale).round() * scale - cut).detach()

    def _widen(self, x: Tensor) -> None:
        low, high = x.amin().clamp(max=0.0), x.amax().clamp(min=0.0)
        if torch.isnan(self.low):
            self.low, self.high = low, high
        self.low, self.high = (
            self.low.lerp(low, 1 - _KEPT_RANGE),
            self.high.lerp(high, 1 - _KEPT_RANGE),
        )


def rounded(network: nn.Module) -> nn.Module:
    """The network with every convolution's weights, input and output rounded; normalizations stay
    what they are."""
    for conv in [m for m in network.modules() if isinstance(m, nn.Conv2d)]:
        parametrize.register_parametrization(conv, "weight", RoundedWeights())
        conv.add_module("rounded_input", RoundedActivations())
        conv.register_forward_pre_hook(lambda module, inputs: (module.rounded_input(inputs[0]),))
    for block in [m for m in network.modules() if isinstance(m, InvertedResidual) and m.skip]:
        block.conv.add_module(
            "rounded_output", RoundedActivations()
        )  # before it is added to what is skipped
    return network.eval()


def loss_of(network: nn.Module, teacher: nn.Module, images: Tensor) -> Tensor:
    """How far what the rounded network sees in (B, 3, H, W) uint8 pictures is from what its teacher
    sees: the Kullback-Leibler divergence a pixel."""
    x = normalize(images).contiguous(memory_format=torch.channels_last)
    with torch.no_grad():
        taught = teacher(x)
        seen = torch.sigmoid(taught)
        least = F.binary_cross_entropy_with_logits(taught, seen)
    return F.binary_cross_entropy_with_logits(network(x), seen) - least


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.rounded", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--network", default="foreground_compact", help="of the manifest")
    picture_arguments(parser)
    parser.add_argument("--minutes", type=float, default=40.0)
    parser.add_argument("--rate", type=float, default=2e-5)
    parser.add_argument("--slots", type=int, default=400)
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(1)
    kind = args.network.removeprefix("foreground_")
    file = WEIGHTS / spec_of(args.network).file
    teacher, network = build(kind, 1), build(kind, 1)
    for one in (teacher, network):
        unfold(file, one)
        one.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    course = Course(
        rounded(network),
        Config(
            minutes=args.minutes,
            rate=args.rate,
            clip=1.0,
            keep=0.99,
            warm_up=0.05,
            weight_decay=0.0,
        ),
    )
    params = CampaignParams(
        minutes=args.minutes, slots=args.slots, reuse=20, plain=0.5, labelled=2.5, empty=1.0
    )
    losses: list[float] = []
    args.folder.mkdir(parents=True, exist_ok=True)
    with mixed(params, load_pool(args.textures), args.photographs, args.empty_pictures) as mixture:
        last = noted = time.monotonic()
        while course.share() < 1:
            losses.append(course.step(loss_of(course.network, teacher, mixture.batch()[0])))
            now = time.monotonic()
            course.seconds, last = course.seconds + now - last, now
            if now - noted > 300 or course.share() >= 1:
                noted, line = (
                    now,
                    {"step": course.steps, "loss": round(float(np.mean(losses[-50:])), 6)},
                )
                print(json.dumps(line), flush=True)
                (args.folder / "rounded.onnx").write_bytes(refold(file, course.result()))


if __name__ == "__main__":
    main()
