"""A Swin learns its stages one by one from a ConvNeXt: ``python -m
models.training.foreground.stages``.

Both have the same stem, the same strides and as many channels in every stage (Liu et al. 2022 drew
the one after the other), so each stage of the student gets what the teacher's had before it and
learns to give what the teacher's gave (block by block, Li et al. 2020). Every stage has a short way
to its own target, where a Swin that begins from random weights learns the first one through all the
others. Stem, last normalization and decoder are the teacher's. The checkpoint is a beginning for
``models.training.foreground.campaign --initial``.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from models.synthesis.textures import load_pool
from models.training.foreground.campaign import (
    CALIBRATION_BATCHES,
    CampaignParams,
    Mixture,
    mixed,
    picture_arguments,
)
from models.training.foreground.initial import unfold
from models.training.foreground.learning import normalize
from models.training.foreground.network_convnext import ConvNeXt
from models.training.foreground.network_deeplab import DeepLab
from models.training.foreground.network_swin import Swin
from models.training.foreground.networks import build
from models.training.state import Course
from models.weights.inference import WEIGHTS, spec_of


class Pair(NamedTuple):
    """Two DeepLabV3+ whose encoders have as many channels in every stage."""

    student: DeepLab
    teacher: DeepLab


def paired(network: str, slim: int, teacher: str, pictures: Sequence[Tensor]) -> Pair:
    """A new ``network`` with stem, last normalization and decoder of ``teacher``, a shipped one,
    whose normalizations take their statistics from ``pictures``, normalized. Raises ValueError
    where the two are no Swin and no ConvNeXt of the same width."""
    spec = spec_of(teacher)
    student = build(network, slim)
    taken_from = build(str(spec.training["network"]), int(spec.training["slim"]))
    if not (isinstance(student, DeepLab) and isinstance(student.features, Swin)):
        raise ValueError(f"network is {network!r}; a Swin learns stage by stage")
    if not (isinstance(taken_from, DeepLab) and isinstance(taken_from.features, ConvNeXt)):
        raise ValueError(f"teacher is {teacher!r}; a Swin learns its stages from a ConvNeXt")
    if student.features.channels != taken_from.features.channels:
        raise ValueError(f"slim is {slim}, of the teacher {spec.training['slim']}")
    unfold(WEIGHTS / spec.file, taken_from, pictures)
    taken_from.eval().requires_grad_(False)
    decoder = {k: v for k, v in taken_from.state_dict().items() if not k.startswith("features.")}
    student.load_state_dict(decoder, strict=False)
    embedding, stem = student.features.patch_embed, taken_from.features.downsample_layers[0]
    assert isinstance(stem, nn.Sequential)
    for own, taken in zip((embedding.proj, embedding.norm), stem, strict=True):
        own.load_state_dict(taken.state_dict())
    student.features.norm.load_state_dict(taken_from.features.norm.state_dict())
    return Pair(student, taken_from)


@torch.no_grad()
def shown(teacher: ConvNeXt, x: Tensor) -> list[Tensor]:
    """What the stem and each of the four stages give for (B, 3, H, W) normalized pictures, (B, h,
    w, C) each."""
    seen = []
    for k, (reduce, stage) in enumerate(
        zip(teacher.downsample_layers, teacher.stages, strict=True)
    ):
        x = reduce(x)
        if k == 0:
            seen.append(x.permute(0, 2, 3, 1))
        x = stage(x)
        seen.append(x.permute(0, 2, 3, 1))
    return seen


def unexplained(student: Swin, seen: Sequence[Tensor]) -> Tensor:
    """(4,) of each stage, given what the teacher's had before it: the mean squared difference to
    what the teacher's gave, over the variance of each channel."""
    stages = list(student.layers)
    errors = []
    for k, (stage, before, true) in enumerate(zip(stages, seen, seen[1:], strict=False)):
        given = stages[k - 1].downsample(before) if k else before
        variance = true.float().var((0, 1, 2)).clamp(min=1e-4)
        errors.append(((stage.blocks(given).float() - true.float()).square() / variance).mean())
    return torch.stack(errors)


def learn(pair: Pair, mixture: Mixture, params: CampaignParams, folder: Path) -> Course:
    """Until the minutes are over, a line of ``stages.jsonl`` every ``check_every``."""
    student, teacher = pair.student.features, pair.teacher.features
    assert isinstance(student, Swin)
    assert isinstance(teacher, ConvNeXt)
    course = Course(pair.student, params.config(), [{"params": list(student.layers.parameters())}])  # type: ignore[attr-defined]
    errors: list[np.ndarray] = []
    checked, last = 0.0, time.monotonic()
    pair.student.train()
    while course.share() < 1:
        x = normalize(mixture.batch()[0])
        with torch.autocast(x.device.type, torch.bfloat16):
            parts = unexplained(student, shown(teacher, x))
        course.step(parts.sum())
        errors.append(parts.detach().numpy())
        now = time.monotonic()
        course.seconds, last = course.seconds + now - last, now
        if course.seconds - checked > 60 * params.check_every or course.share() >= 1:
            checked = course.seconds
            _check(course, params, folder, np.mean(errors, 0))
            errors = []
    return course


def _check(course: Course, params: CampaignParams, folder: Path, errors: np.ndarray) -> None:
    course.save(folder / "stages.pt", params=asdict(params))
    line = {
        "step": course.steps,
        "minutes": round(course.seconds / 60, 1),
        "unexplained": errors.round(3).tolist(),
    }
    print(json.dumps(line), flush=True)
    with (folder / "stages.jsonl").open("a") as file:
        file.write(json.dumps(line) + "\n")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.stages", description=__doc__
    )
    parser.add_argument("folder", type=Path, help="gets stages.pt")
    parser.add_argument(
        "--teacher", default="foreground_deeplab_convnext_t", help="a shipped network"
    )
    parser.add_argument("--network", default="deeplab_swin_t")
    parser.add_argument("--slim", type=int, default=4)
    picture_arguments(parser)
    parser.add_argument("--minutes", type=float, default=40.0)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=21)
    args = parser.parse_args(arguments)
    torch.set_num_threads(1)
    params = CampaignParams(
        network=args.network,
        slim=args.slim,
        height=224,
        width=224,
        minutes=args.minutes,
        labelled=2.0,
        empty=0.8,
        plain=0.4,
        rate=args.rate,
        decay=0.998,
        seed=args.seed,
        reuse=14,
        check_every=4.0,
    )
    args.folder.mkdir(parents=True, exist_ok=True)
    try:
        with mixed(
            params, load_pool(args.textures), args.photographs, args.empty_pictures
        ) as mixture:
            pictures = [normalize(mixture.batch()[0]) for _ in range(CALIBRATION_BATCHES)]
            pair = paired(args.network, args.slim, args.teacher, pictures)
            learn(pair, mixture, params, args.folder)
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
