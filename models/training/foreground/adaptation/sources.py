"""What an adaptation learns from: the place's own labelled pictures, and renders so that the rest
is not forgotten."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from models.geometry.arrays import BoolArray, ByteArray
from models.segmentation.segment import ForegroundInput, network_scale
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool
from models.training.foreground.augmentation import Cut, Rng, cut_out, recolored
from models.training.foreground.real_pictures import Photograph, photograph

GROUNDS = Path(__file__).parent.parent / "grounds"
"""Backgrounds that ship with this repository, so that renders need nothing else."""
_REHEARSAL_SEED, _GENERAL_SEED = 30_000_001, 30_000_002
_LONGEST_PX = 960
_LEAST_PICTURES = 3


@dataclass(frozen=True)
class Own:
    """The place's pictures: those that train, and those that only measure."""

    trains: tuple[Photograph, ...]
    aside: tuple[Photograph, ...]


@dataclass(frozen=True)
class Rehearsal:
    """``images`` (n, h, w, 3) of renders and their ``labels`` (n, h, w), 255 cable."""

    images: ByteArray
    labels: ByteArray


def read_own(folder: Path, keep_aside: float) -> Own:
    """``imgs/NAME.png`` and ``masks/NAME.png`` (255 cable, 0 not, 128 cannot tell). The share
    ``keep_aside``, one at least, never trains; which they are depends on the names alone.

    Raises ValueError for less than 3 pictures, and for none with a cable among those that train.
    """
    files = sorted((folder / "imgs").iterdir(), key=lambda f: (zlib.crc32(f.stem.encode()), f.stem))
    if len(files) < _LEAST_PICTURES:
        raise ValueError(
            f"{len(files)} pictures are too few to adapt from; {_LEAST_PICTURES} are the least"
        )
    count = min(max(round(keep_aside * len(files)), 1), len(files) - 2)
    pictures = [_reduced(photograph(f, folder / "masks" / f"{f.stem}.png")) for f in files]
    own = Own(tuple(pictures[count:]), tuple(pictures[:count]))
    if not any(len(p.marked) for p in own.trains):
        raise ValueError("no picture that is not kept aside shows a cable")
    return own


def _reduced(own: Photograph) -> Photograph:
    """At most ``_LONGEST_PX`` long: cuts of large pictures are shrunk anyway, and hundreds have to
    fit in memory."""
    factor = _LONGEST_PX / max(own.labels.shape)
    if factor >= 1:
        return own
    size = round(own.labels.shape[1] * factor), round(own.labels.shape[0] * factor)
    rgb = np.asarray(cv2.resize(own.rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    labels = np.asarray(cv2.resize(own.labels, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    return Photograph(own.name, rgb, labels, own.marked * factor)


def rehearsal(size: tuple[int, int], count: int, pool: TexturePool | None = None) -> Rehearsal:
    """``count`` renders of ``size`` (h, w) of the kind that the shipped networks are trained on."""
    pool = pool or load_pool(GROUNDS)
    scenes = [
        render_scene(np.random.default_rng([_REHEARSAL_SEED, k]), SceneParams(size), pool)
        for k in range(count)
    ]
    labels = np.stack([(scene.ids > 0).numpy().astype(np.uint8) * 255 for scene in scenes])
    return Rehearsal(np.stack([to_uint8(scene.rgb) for scene in scenes]), labels)


def general_set(
    count: int, size: tuple[int, int] = (360, 640)
) -> list[tuple[ByteArray, BoolArray]]:
    """Renders that no adaptation learns from, always the same: what a network must not forget."""
    pool, params = load_pool(GROUNDS), SceneParams(size, empty_share=0.0)
    scenes = (
        render_scene(np.random.default_rng([_GENERAL_SEED, k]), params, pool) for k in range(count)
    )
    return [(to_uint8(scene.rgb), (scene.ids > 0).numpy()) for scene in scenes]


class Batches:
    """Batches of cuts, of which the share ``real`` is of the place's own pictures (w_r of thesis
    2.7.2)."""

    def __init__(
        self, own: Own, renders: Rehearsal, real: float, fed: ForegroundInput, rng: Rng
    ) -> None:
        self._own, self._renders, self._real, self._rng = own, renders, real, rng
        size = renders.labels.shape[1], renders.labels.shape[2]
        self._cuts = [_seen(p, size, fed) for p in own.trains]
        self._rendered = Cut(size, (0.8, 1.4), 0.2)

    def draw(self, count: int) -> tuple[Tensor, Tensor]:
        """(count, 3, h, w) uint8 pictures and (count, h, w) uint8 labels."""
        pairs = [self._one() for _ in range(count)]
        images = np.stack([recolored(image, self._rng).transpose(2, 0, 1) for image, _ in pairs])
        return torch.from_numpy(images), torch.from_numpy(np.stack([labels for _, labels in pairs]))

    def _one(self) -> tuple[ByteArray, ByteArray]:
        if self._rng.random() < self._real:
            k = int(self._rng.integers(len(self._cuts)))
            return self._own.trains[k].sample(self._rng, self._cuts[k])
        k = int(self._rng.integers(len(self._renders.images)))
        return cut_out(self._renders.images[k], self._renders.labels[k], self._rendered, self._rng)


def _seen(own: Photograph, size: tuple[int, int], fed: ForegroundInput) -> Cut:
    """About the scale at which the network sees the whole picture."""
    scale = network_scale(own.labels.shape, fed)
    return Cut(size, (0.65 * scale, 1.5 * scale), 0.25)
