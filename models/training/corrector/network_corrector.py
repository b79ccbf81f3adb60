"""The corrector: an upright crop to the probability of every column to be the DLO's centerline
(thesis 2.5.3).

The backbone has ResNet-18's shape (He et al. 2016: four stages of two basic blocks) at a fraction
of its width. The thesis pools its last features over the whole crop and lets two linear layers find
the column. Here every stage keeps its columns: its rows are weighted and summed, and the columns of
all stages meet at full resolution, as in a feature pyramid. Where something is then costs no memory
of the network. The first convolution skips twice as many rows as columns: what stands upright
changes slowly down the rows.
"""

from __future__ import annotations

from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from models.tracked_labels.crops import SIZE

ROWS = 64
"""Rows of the crop that are looked at, the middle ones: what is farther along the DLO adds little
and costs as much."""


class BasicBlock(nn.Module):
    """Two 3×3 convolutions and a shortcut."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False),
            nn.BatchNorm2d(outputs),
        )
        same = stride == 1 and inputs == outputs
        self.shortcut = (
            nn.Identity()
            if same
            else nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)
            )
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x) + self.shortcut(x))


class ColumnTap(nn.Module):
    """(B, C, h, w) to (B, lines, SIZE): a weighted sum over the rows, then as many columns as the
    crop has."""

    def __init__(self, channels: int, rows: int, lines: int) -> None:
        super().__init__()
        self.rows = nn.Parameter(torch.full((channels, rows), 1.0 / rows))
        self.mix = nn.Conv1d(channels, lines, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        columns = F.conv2d(x, self.rows[:, None, :, None], groups=len(self.rows))[:, :, 0]
        return F.interpolate(self.mix(columns), size=SIZE, mode="linear", align_corners=False)


class CorrectorNetwork(nn.Module):
    """``width`` is the share of ResNet-18's channels, up to its third stage: the last has as many
    as that one, since it would hold most of the weights. Outputs a line of logits and the logarithm
    of the width."""

    def __init__(self, width: float = 0.375, lines: int = 64) -> None:
        super().__init__()
        channels = [round(width * full) for full in (64, 64, 128, 256, 256)]
        self.stem = nn.Sequential(
            nn.Conv2d(3, channels[0], 7, (4, 2), 3, bias=False),
            nn.BatchNorm2d(channels[0]),
            nn.ReLU(inplace=True),
        )
        stages = []
        for k, (inputs, outputs) in enumerate(pairwise(channels)):
            stride = 1 if k == 0 else 2
            stages.append(
                nn.Sequential(BasicBlock(inputs, outputs, stride), BasicBlock(outputs, outputs, 1))
            )
        self.stages = nn.ModuleList(stages)
        rows = (ROWS // 4, ROWS // 8, ROWS // 16, ROWS // 32, ROWS // 64)
        self.taps = nn.ModuleList(
            ColumnTap(c, r, lines) for c, r in zip(channels, rows, strict=True)
        )
        # Which of several DLOs is meant follows from the place alone: the one nearest to the
        # middle.
        self.place = nn.Parameter(torch.zeros(lines, SIZE))
        self.line = nn.Sequential(
            nn.ReLU(),
            nn.Conv1d(lines, lines, 5, padding=2),
            nn.ReLU(),
            nn.Conv1d(lines, 1, 5, padding=2),
        )
        self.size = nn.Sequential(
            nn.ReLU(), nn.Conv1d(lines, 32, 5, padding=2), nn.ReLU(), nn.Conv1d(32, 1, 1)
        )

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """``crops`` (B, SIZE, SIZE, 3), 0 to 255, to logits (B, SIZE) of the centerline's column on
        the middle row and (B, SIZE) logarithms of the width in pixels of the crop, one for each
        column that could be the centerline."""
        above = (SIZE - ROWS) // 2
        x = (crops[:, above : above + ROWS].permute(0, 3, 1, 2).float() - 127.5) / 64.0
        x = self.stem(x)
        lines = self.place + self.taps[0](x)
        x = F.max_pool2d(x, 3, 2, 1)
        for stage, tap in zip(self.stages, list(self.taps)[1:], strict=True):
            x = stage(x)
            lines = lines + tap(x)
        return self.line(lines)[:, 0], self.size(lines)[:, 0] + 2.5


class CorrectorProbabilities(nn.Module):
    """What is exported: columns as probabilities that sum to 1, widths in pixels of the crop. Each
    crop is looked at twice, the second time turned by half a turn, and the mean of both is given:
    their mistakes differ."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        columns, widths = self._once(crops)
        turned_columns, turned_widths = self._once(crops.flip(1, 2))
        return (columns + turned_columns.flip(1)) / 2, (widths + turned_widths.flip(1)) / 2

    def _once(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        logits, sizes = self.network(crops)
        return torch.softmax(logits, 1), torch.exp(sizes)
