"""Rasterizing a curve of some width into the pixels it covers, in torch.

Strategy: the ribbon is a cloud of points, one per curve sample and offset across the width. Every point
falls into one pixel; a pixel keeps the sample that lies on top (largest height, then latest). The distance
of the pixel's center to that sample's tangent line is then computed exactly, so that edges are smooth
without rendering at a higher resolution.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.curves import normals


@dataclass(frozen=True)
class Ribbon:
    """P covered pixels of a strand. ``index`` (P,) flat pixel index; ``sample`` (P,) curve sample;
    ``offset`` (P,) signed distance from the centerline in half-widths; ``alpha`` (P,) coverage 0 to 1;
    ``normal_xy`` (P, 2) of the curve; ``height`` (P,)."""

    index: Tensor
    sample: Tensor
    offset: Tensor
    alpha: Tensor
    normal_xy: Tensor
    height: Tensor


def rasterize(
    curve: NDArray[np.float32], half_width: NDArray[np.float32], size: tuple[int, int], device: torch.device
) -> Ribbon:
    """``curve`` (m, 3) dense x, y, z; ``half_width`` (m,) px; ``size`` (height, width) of the picture."""
    height, width = size
    xyz = torch.as_tensor(curve, device=device)
    normal = torch.as_tensor(normals(curve), device=device)
    half = torch.as_tensor(half_width, device=device)
    reach = float(half.max()) + 1.0
    across = torch.arange(-reach, reach + 0.7, 0.7, device=device)
    cloud = (xyz[:, None, :2] + normal[:, None] * across[None, :, None]).round().long()
    inside = ((cloud >= 0) & (cloud < torch.tensor([width, height], device=device))).all(2)
    inside &= across.abs()[None] <= half[:, None] + 1.0
    which = torch.arange(len(curve), device=device)[:, None].expand(inside.shape)[inside]
    flat = (cloud[..., 1] * width + cloud[..., 0])[inside]
    rank = (xyz[which, 2] * 1023).long() * (1 << 20) + which
    top = torch.full((height * width,), -1, dtype=torch.long, device=device)
    top.scatter_reduce_(0, flat, rank, "amax")
    index = torch.nonzero(top >= 0).squeeze(1)
    sample = top[index] % (1 << 20)
    center = torch.stack([index % width, index // width], 1).float()
    distance = ((center - xyz[sample, :2]) * normal[sample]).sum(1)
    alpha = (half[sample] + 0.5 - distance.abs()).clamp(0.0, 1.0)
    return Ribbon(index, sample, (distance / half[sample]).clamp(-1, 1), alpha, normal[sample], xyz[sample, 2])


def strands(curve: NDArray[np.float32], pieces: int) -> list[NDArray[np.int64]]:
    """Sample indices of ``curve`` in ``pieces`` runs, lowest first: drawn in this order a self-crossing's
    upper strand blends over the lower one. Neighbors share a sample, so no seam shows."""
    cuts = np.linspace(0, len(curve), pieces + 1).astype(int)
    runs = [np.arange(max(a - 1, 0), b) for a, b in pairwise(cuts.tolist()) if b - a > 1]
    return sorted(runs, key=lambda run: float(curve[run, 2].mean()))
