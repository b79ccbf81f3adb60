"""A network that already knows cables, as a teacher of another one (knowledge distillation, Hinton
et al. 2015).

Where nobody could tell, a teacher that is sure can; everywhere else its probability, softer than a
label, stands beside it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from models.geometry.arrays import ByteArray, Float32Array
from models.segmentation.segment import ForegroundInput, enlarged, probability_at
from models.training.foreground.augmentation import UNKNOWN, Rng
from models.weights.inference import Runtime, load

_SCALES = (2 / 3, 1.0, 4 / 3)
_SURE = 0.4
"""Distance of a probability from one half where the teacher counts although nobody could tell."""

Look = Callable[[ByteArray, float], Float32Array]
"""(H, W, 3) RGB and a scale to (H, W) probability."""


class Teacher:
    """Looks at each picture once, at one of three scales and mirrored or not, by chance: over many
    steps a student learns the mean of all six."""

    def __init__(self, look: Look, rng: Rng) -> None:
        self.look, self.rng = look, rng

    @classmethod
    def shipped(cls, name: str, rng: Rng) -> Teacher:
        """The network ``name`` of the manifest. Raises UnknownNetworkError."""
        network = load(name, Runtime(threads=1))
        settings = ForegroundInput.from_manifest(network.spec.preprocess)
        return cls(lambda image, scale: probability_at(image, network, settings, scale), rng)

    def __call__(self, images: Tensor) -> Tensor:
        """(B, 3, H, W) uint8 pictures to (B, H, W) probability."""
        return torch.from_numpy(
            np.stack([self._seen(image) for image in images.permute(0, 2, 3, 1).numpy()])
        )

    def _seen(self, image: ByteArray) -> Float32Array:
        mirrored = self.rng.random() < 0.5
        picture = np.ascontiguousarray(image[:, ::-1] if mirrored else image)
        seen = self.look(picture, self.rng.choice(_SCALES))
        seen = enlarged(seen, image.shape[:2])
        return np.ascontiguousarray(seen[:, ::-1] if mirrored else seen)


def taught_loss(logits: Tensor, labels: Tensor, seen: Tensor) -> Tensor:
    """Cross entropy to what a teacher sees, where it is sure or somebody could tell.

    ``logits`` (B, 1, H, W), ``labels`` (B, H, W) with 128 where nobody could tell, ``seen`` (B, H,
    W) probability.
    """
    counts = ((labels != UNKNOWN) | ((seen - 0.5).abs() > _SURE)).float()
    entropy = F.binary_cross_entropy_with_logits(logits.squeeze(1), seen, reduction="none")
    return (entropy * counts).sum() / counts.sum().clamp(min=1)
