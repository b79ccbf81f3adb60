"""A ring of rendered scenes that other processes keep renewing while training reads from it.

Rendering and training run at different speeds: the trainer never waits for a scene, it sees some
twice; the renderers rest when the ring is full of scenes that nobody has drawn yet. Scene k of a
run is always the same picture (seed, k).
"""

from __future__ import annotations

import os
import time
from multiprocessing.sharedctypes import Synchronized

import numpy as np
import torch
import torch.multiprocessing as mp
from torch import Tensor

from models.synthesis.scenes import SceneParams, render_scene
from models.synthesis.textures import TexturePool

_REST_S = 0.05


class SceneStream:
    """``slots`` scenes in shared memory; ``renderers`` processes replace the oldest one after
    another, one new scene for every ``reuse`` that were drawn."""

    def __init__(
        self,
        params: SceneParams,
        pool: TexturePool,
        *,
        seed: int,
        slots: int,
        renderers: int,
        reuse: int = 1,
    ) -> None:
        height, width = params.size
        self.images = torch.zeros((slots, 3, height, width), dtype=torch.uint8).share_memory_()
        self.masks = torch.zeros((slots, height, width), dtype=torch.uint8).share_memory_()
        context = mp.get_context("spawn")
        self.rendered: Synchronized[int] = context.Value("q", 0)
        self._drawn: Synchronized[int] = context.Value("q", 0)
        self._processes = [
            context.Process(
                target=_render_forever,
                args=(
                    params,
                    pool,
                    seed,
                    self.images,
                    self.masks,
                    self.rendered,
                    self._drawn,
                    reuse,
                ),
                daemon=True,
            )
            for _ in range(renderers)
        ]
        for process in self._processes:
            process.start()

    def filled(self) -> int:
        """How many slots hold a scene (a few of the newest may still be in the making)."""
        return min(max(self.rendered.value - len(self._processes), 0), len(self.images))

    def batch(self, rng: np.random.Generator, size: int) -> tuple[Tensor, Tensor]:
        """(size, 3, H, W) uint8 pictures and (size, H, W) uint8 masks, flipped and recolored at
        random."""
        images, masks = self.draw(rng, size)
        for k in range(size):
            axes = [axis for axis in (1, 2) if rng.random() < 0.5]
            image = images[k].flip(axes) if axes else images[k]
            images[k] = image[torch.as_tensor(rng.permutation(3))] if rng.random() < 0.4 else image
            masks[k] = masks[k].flip([a - 1 for a in axes]) if axes else masks[k]
        return images, masks

    def draw(self, rng: np.random.Generator, size: int) -> tuple[Tensor, Tensor]:
        """(size, 3, H, W) uint8 pictures and (size, H, W) uint8 masks as they were rendered."""
        picks = torch.as_tensor(rng.integers(self.filled(), size=size))
        self._drawn.value += size
        return self.images[picks], self.masks[picks]

    def close(self) -> None:
        for process in self._processes:
            process.terminate()


def _render_forever(
    params: SceneParams,
    pool: TexturePool,
    seed: int,
    images: Tensor,
    masks: Tensor,
    rendered: Synchronized[int],
    drawn: Synchronized[int],
    reuse: int,
) -> None:
    torch.set_num_threads(1)
    parent = os.getppid()
    while os.getppid() == parent:  # an orphan would render for ever
        if rendered.value >= len(images) + drawn.value // reuse:
            time.sleep(_REST_S)
            continue
        with rendered.get_lock():
            k = rendered.value
            rendered.value += 1
        scene = render_scene(np.random.default_rng([seed, k]), params, pool)
        images[k % len(images)] = (scene.rgb * 255).round().byte()
        masks[k % len(masks)] = (scene.ids > 0).byte()
