"""Rasterizing a curve of some width into the pixels it covers, in torch.

Strategy: the ribbon is a cloud of points, one per curve sample and offset across the width. Every
point falls into one pixel of the strand's bounding box; a pixel keeps the latest sample. The
distance of the pixel's center to that sample's tangent line is then computed exactly, so that edges
are smooth without rendering at a higher resolution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.curves import normals

STEP_PX = 0.7
"""Spacing of curve samples and of points across: a grid finer than 1/√2 leaves no pixel out."""


@dataclass(frozen=True)
class Strand:
    """m samples of a curve: ``xy`` (m, 2), ``normal`` (m, 2), ``half`` (m,) width, ``first`` the
    number of its first sample along the whole cable."""

    xy: Tensor
    normal: Tensor
    half: Tensor
    first: int = 0

    def cut(self, start: int, stop: int) -> Strand:
        """Samples ``start`` to ``stop`` (exclusive, clipped); numbers stay those of the whole
        cable."""
        start = max(start, 0)
        return Strand(
            self.xy[start:stop], self.normal[start:stop], self.half[start:stop], self.first + start
        )

    def scaled(self, factor: float) -> Strand:
        """The same strand in a picture ``factor`` as large."""
        return replace(self, xy=(self.xy + 0.5) * factor - 0.5, half=self.half * factor)


@dataclass(frozen=True)
class Ribbon:
    """P covered pixels of a strand. ``index`` (P,) flat pixel index; ``sample`` (P,) sample of the
    strand; ``offset`` (P,) signed distance from the centerline in half-widths; ``alpha`` (P,)
    coverage 0 to 1; ``normal`` (2, P) of the curve."""

    index: Tensor
    sample: Tensor
    offset: Tensor
    alpha: Tensor
    normal: Tensor


def strand(
    curve: NDArray[np.float32], half_width: NDArray[np.float32], device: torch.device
) -> Strand:
    """From ``curve`` (m, ≥ 2) of dense x, y and ``half_width`` (m,) px."""
    return Strand(
        torch.as_tensor(curve[:, :2], device=device),
        torch.as_tensor(normals(curve), device=device),
        torch.as_tensor(half_width, device=device),
    )


def rasterize(ribbon_of: Strand, size: tuple[int, int]) -> Ribbon:
    """``size`` (height, width) of the picture; what lies outside is left out."""
    seen, reach = _near(ribbon_of, size)
    if len(seen) == 0:
        return _nothing(ribbon_of.xy.device)
    xy, normal, half = ribbon_of.xy[seen], ribbon_of.normal[seen], ribbon_of.half[seen]
    left, upper, columns, rows = _window(xy, reach, size)
    across = torch.arange(-reach, reach + STEP_PX, STEP_PX, device=xy.device)
    x = (xy[:, :1] + normal[:, :1] * across).sub_(left).round_()
    y = (xy[:, 1:] + normal[:, 1:] * across).sub_(upper).round_()
    inside = (
        (x >= 0) & (x < columns) & (y >= 0) & (y < rows) & (across.abs() <= half[:, None] + 1.0)
    )
    cell = torch.where(
        inside, y * columns + x, float(rows * columns)
    ).long()  # the last cell is thrown away
    top = torch.full((rows * columns + 1,), -1, dtype=torch.int32, device=xy.device)
    order = torch.arange(len(seen), dtype=torch.int32, device=xy.device)[:, None]
    top.scatter_reduce_(0, cell.view(-1), order.expand(cell.shape).reshape(-1), "amax")
    covered = torch.nonzero(top[:-1] >= 0).squeeze(1)
    sample = top[covered].long()
    x, y = covered % columns + left, torch.div(covered, columns, rounding_mode="floor") + upper
    at, across_xy, half_here = xy[sample].T, normal[sample].T, half[sample]
    distance = (x - at[0]) * across_xy[0] + (y - at[1]) * across_xy[1]
    alpha = (half_here + 0.5 - distance.abs()).clamp_(0.0, 1.0)
    offset = (distance / half_here.clamp(min=1e-3)).clamp_(-1, 1)
    return Ribbon(y * size[1] + x, seen[sample], offset, alpha, across_xy)


def _near(ribbon_of: Strand, size: tuple[int, int]) -> tuple[Tensor, float]:
    """Numbers of the samples that may reach into the picture, and the largest half-width plus a
    pixel."""
    reach = float(ribbon_of.half.max()) + 1.0 if len(ribbon_of.half) else 0.0
    x, y = ribbon_of.xy[:, 0], ribbon_of.xy[:, 1]
    near = (x > -reach) & (x < size[1] + reach) & (y > -reach) & (y < size[0] + reach)
    return torch.nonzero(near).squeeze(1), reach


def _window(xy: Tensor, reach: float, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, upper, columns and rows of the bounding box inside the picture."""
    low, high = xy.amin(0).tolist(), xy.amax(0).tolist()
    left, upper = (max(int(v - reach), 0) for v in low)
    right, lower = (
        min(int(v + reach) + 2, limit) for v, limit in zip(high, size[::-1], strict=True)
    )
    return left, upper, max(right - left, 1), max(lower - upper, 1)


def _nothing(device: torch.device) -> Ribbon:
    whole, real = torch.zeros(0, dtype=torch.long, device=device), torch.zeros(0, device=device)
    return Ribbon(whole, whole, real, real, torch.zeros(2, 0, device=device))
