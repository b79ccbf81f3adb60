"""A student's encoder is shown what its teacher's sees (hints, Romero et al. 2015), beside what is
answered in the end.

An encoder that begins from random weights learns its first layers only slowly through all the
others. A teacher of another architecture has useful features at the same strides: from the
student's a 1 × 1 convolution is to tell them.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from models.training.foreground.initial import unfold
from models.training.foreground.network_compact import CompactNetwork
from models.training.foreground.network_deeplab import DeepLab
from models.weights.inference import WEIGHTS, spec_of

_LOW, _HIGH = 0, {16: 2, 32: 3}
"""Places among what the compact encoder sees: at stride 4, and by the stride of the student's
high-level features."""


class Shown(NamedTuple):
    """What a teacher answers, (B, H, W) probability, and what its encoder sees: (B, C, H/4, W/4),
    (B, C, h, w)."""

    probability: Tensor
    low: Tensor
    high: Tensor


class Hints(nn.Module):
    """A compact network of the manifest as the teacher of a DeepLabV3+; trained with the student,
    of use to nobody afterwards."""

    def __init__(self, teacher: str, student: DeepLab) -> None:
        """Raises ValueError for a teacher that is not in the manifest or no compact network, and
        for a student that is no DeepLabV3+."""
        super().__init__()
        if not isinstance(student, DeepLab):
            raise ValueError("hints are for the deeplab networks")
        network = CompactNetwork()
        unfold(WEIGHTS / spec_of(teacher).file, network)
        network.eval().requires_grad_(False).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._teacher = [network]  # not a part of what is trained
        self._place = _HIGH[student.features.stride]
        with torch.no_grad():
            seen = network.encoded(torch.zeros(1, 3, 32, 32))
        low, high = student.features.channels
        self.low = nn.Conv2d(low, seen[_LOW].shape[1], 1)
        self.high = nn.Conv2d(high, seen[self._place].shape[1], 1)

    @torch.no_grad()
    def shown(self, x: Tensor) -> Shown:
        """Of (B, 3, H, W) normalized pictures."""
        teacher = self._teacher[0].to(x.device)
        taps = teacher.encoded(x)
        probability = torch.sigmoid(teacher.decoded(taps).float()).squeeze(1)
        return Shown(probability, taps[_LOW], taps[self._place])

    def forward(self, shown: Shown, low: Tensor, high: Tensor) -> Tensor:
        """How badly the student's ``low`` and ``high`` features tell the teacher's: the mean
        squared error over the variance of each channel, so that 1 is to know nothing."""
        return (
            _unexplained(self.low(low), shown.low) + _unexplained(self.high(high), shown.high)
        ) / 2


def _unexplained(told: Tensor, true: Tensor) -> Tensor:
    true = true.float()
    variance = true.var((0, 2, 3), keepdim=True).clamp(min=1e-4)
    mean = true.mean((0, 2, 3), keepdim=True)
    return F.mse_loss(told.float(), (true - mean) / variance.sqrt())
