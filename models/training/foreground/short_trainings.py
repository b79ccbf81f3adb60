"""Short trainings of a foreground network on pictures in memory, equally long: they compare."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from models.geometry.arrays import BoolArray, ByteArray
from models.synthesis.datasets import Mixture, load, samples_in
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool
from models.training.foreground.augmentation import UNKNOWN
from models.training.foreground.learning import Learning, normalize
from models.training.foreground.real_pictures import load_labelled
from models.training.state import Config

THRESHOLD = 0.5


Labelled = tuple[str, NDArray[np.uint8], NDArray[np.uint8]]
"""Name, (H, W, 3) RGB and (H, W) labels: 255 cable, 0 none, 128 cannot tell."""


@dataclass(frozen=True)
class Pictures:
    """N training pictures of one size: ``images`` (N, 3, H, W) and ``labels`` (N, H, W), both
    uint8."""

    images: Tensor
    labels: Tensor

    def taken(self, numbers: NDArray[np.int64]) -> Pictures:
        return Pictures(self.images[numbers], self.labels[numbers])


@dataclass(frozen=True)
class Arm:
    """One training: its sources and their ratios (eq. 2.5), and the network by name, its channels
    by ``slim``."""

    sources: Sequence[Pictures]
    weights: Sequence[float]
    seed: int
    network: str = "compact"
    slim: int = 1


def stack(pictures: Iterable[Labelled], size: tuple[int, int]) -> Pictures:
    """Stretched to ``size`` (height, width), so that every picture fits the network whole."""
    images, reduced = [], []
    for _, rgb, labels in pictures:
        images.append(cv2.resize(rgb, size[::-1], interpolation=cv2.INTER_AREA).transpose(2, 0, 1))
        shares = [
            cv2.resize(
                (labels == value).astype(np.float32), size[::-1], interpolation=cv2.INTER_AREA
            )
            > 0.5
            for value in (255, UNKNOWN)
        ]
        reduced.append(np.select(shares, [255, UNKNOWN], 0).astype(np.uint8))
    return Pictures(torch.from_numpy(np.stack(images)), torch.from_numpy(np.stack(reduced)))


def from_folder(folder: Path, fit: bool = False) -> Iterator[Labelled]:
    for sample in samples_in(folder):
        rgb, foreground = load(sample, fit)
        yield sample.name, rgb, np.where(foreground, 255, 0).astype(np.uint8)


def marked(folder: Path, aside: bool = False) -> Iterator[Labelled]:
    """Hand-marked photographs that train, or those kept aside, and where in them nobody can tell
    (``real_pictures.py``)."""
    for photograph in load_labelled(folder, aside).photographs:
        yield photograph.name, photograph.rgb, photograph.labels


def rendered(count: int, params: SceneParams, pool: TexturePool, seed: int) -> Iterator[Labelled]:
    for k in range(count):
        scene = render_scene(np.random.default_rng([seed, k]), params, pool)
        yield (
            f"{k:06d}",
            to_uint8(scene.rgb),
            np.where(scene.ids.numpy() > 0, 255, 0).astype(np.uint8),
        )


def fit(arm: Arm, minutes: float, batch: int, encoder: Mapping[str, Tensor] | None) -> Learning:
    """Train for ``minutes``, if any, from the ``encoder``'s weights; the averaged network is the
    result."""
    config = Config(
        seed=arm.seed, minutes=minutes, batch=batch, rate=1.2e-3, keep=0.998, clip=5.0, warm_up=0.03
    )
    learning = Learning(arm.network, arm.slim, config, encoder_rate=0.4)
    # On a shared processor only its own time makes two trainings equally long.
    clock = time.monotonic if learning.device.type == "cuda" else time.process_time
    if encoder is not None:
        learning.network.load_encoder(encoder)
        learning.average.load_state_dict(learning.network.state_dict())
    if not minutes:
        return learning
    rng = np.random.default_rng(arm.seed)
    mixture = Mixture([len(s.images) for s in arm.sources], arm.weights, rng)
    learning.network.train()
    started = clock()
    while learning.course.share() < 1:
        drawn = mixture.draw(100 * batch)  # large enough for the ratios to come out exactly
        for k in range(0, len(drawn), batch):
            learning.step(*_batch(arm.sources, drawn[k : k + batch], rng))
            learning.course.seconds = clock() - started
            if learning.course.share() == 1:
                break
    return learning


def _batch(
    sources: Sequence[Pictures], picks: Sequence[tuple[int, int]], rng: np.random.Generator
) -> tuple[Tensor, ...]:
    """Flipped, and channels shuffled, at random."""
    images, labels = [], []
    for source, number in picks:
        axes = [axis for axis in (-2, -1) if rng.random() < 0.5]
        image = sources[source].images[number]
        shuffled = image[torch.as_tensor(rng.permutation(3))] if rng.random() < 0.4 else image
        images.append(shuffled.flip(axes))
        labels.append(sources[source].labels[number].flip(axes))
    return torch.stack(images), torch.stack(labels)


def mask_of(learning: Learning, size: tuple[int, int]) -> Callable[[ByteArray], BoolArray]:
    """What the network finds in a picture (H, W, 3) stretched to ``size``, (H, W)."""

    @torch.no_grad()
    def found(rgb: ByteArray) -> BoolArray:
        unlabelled = np.zeros(rgb.shape[:2], np.uint8)
        image = stack([("", rgb, unlabelled)], size).images.to(learning.device)
        logits = F.interpolate(learning.average(normalize(image)), rgb.shape[:2], mode="bilinear")
        return np.asarray((torch.sigmoid(logits)[0, 0] > THRESHOLD).cpu().numpy(), bool)

    return found


def dice(find: Callable[[ByteArray], BoolArray], test: Iterable[Labelled]) -> dict[str, float]:
    """Mean Dice in percent at the pictures' own size where one can tell, ``all`` and by category
    (NAME before ``_``)."""
    groups: dict[str, list[float]] = {"all": []}
    for name, rgb, labels in test:
        mask = labels == 255
        if not mask.any():
            continue
        found = find(rgb) & (labels != UNKNOWN)
        score = (
            200.0
            * np.count_nonzero(found & mask)
            / (np.count_nonzero(found) + np.count_nonzero(mask))
        )
        for group in {"all", name.split("_")[0] if "_" in name else "all"}:
            groups.setdefault(group, []).append(score)
    return {group: round(float(np.mean(scores)), 2) for group, scores in sorted(groups.items())}
