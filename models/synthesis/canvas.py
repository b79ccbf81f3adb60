"""A picture being painted: color, instance ids and depth order, with soft-edged primitives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

Vector = Sequence[float] | NDArray[Any]
"""Two coordinates in pixels, or three color values 0 to 1."""


class Canvas:
    """``rgb`` (3, H, W) float 0 to 1, ``ids`` (H, W) int16: 0 background, else the DLO on top."""

    def __init__(self, rgb: Tensor) -> None:
        self.rgb = rgb
        self.height, self.width = rgb.shape[1:]
        self.ids = torch.zeros(rgb.shape[1:], dtype=torch.int16, device=rgb.device)

    @property
    def size(self) -> tuple[int, int]:
        return self.height, self.width

    def box(
        self, center: Vector, half: Vector, angle: float, color: Vector | Tensor, *,
        corner: float = 0.0, opacity: float = 1.0, bevel: float = 0.0, covers: bool = False,
    ) -> None:  # fmt: skip
        """Rotated rectangle with round corners (px, rad); ``bevel`` shades it along its own y axis.
        ``covers`` clears the ids below (an object lying on the DLOs)."""
        window = self._window(center, math.hypot(half[0], half[1]) + 2)
        if window is None:
            return
        rows, columns, x, y = window
        cos, sin = math.cos(angle), math.sin(angle)
        u = (x - center[0]) * cos + (y - center[1]) * sin
        v = (y - center[1]) * cos - (x - center[0]) * sin
        qx, qy = u.abs() - half[0] + corner, v.abs() - half[1] + corner
        signed = torch.hypot(qx.clamp(min=0), qy.clamp(min=0)) + torch.maximum(qx, qy).clamp(max=0) - corner
        shade = 1 + bevel * (v / max(half[1], 1e-3)).clamp(-1, 1)
        self._blend(rows, columns, signed, color, opacity, shade, covers)

    def disc(
        self, center: Vector, radius: float, color: Vector | Tensor, *,
        opacity: float = 1.0, bevel: float = 0.0, covers: bool = False,
    ) -> None:  # fmt: skip
        window = self._window(center, radius + 2)
        if window is None:
            return
        rows, columns, x, y = window
        signed = torch.hypot(x - center[0], y - center[1]) - radius
        shade = 1 + bevel * ((y - center[1]) / max(radius, 1e-3)).clamp(-1, 1)
        self._blend(rows, columns, signed, color, opacity, shade, covers)

    def darken(self, alpha: Tensor, strength: float) -> None:
        """Multiply by a shadow; ``alpha`` (H, W) 0 to 1."""
        self.rgb = self.rgb * (1 - strength * alpha)

    def _window(self, center: Vector, reach: float) -> tuple[slice, slice, Tensor, Tensor] | None:
        x0, x1 = max(int(center[0] - reach), 0), min(int(center[0] + reach) + 2, self.width)
        y0, y1 = max(int(center[1] - reach), 0), min(int(center[1] + reach) + 2, self.height)
        if x0 >= x1 or y0 >= y1:
            return None
        device = self.rgb.device
        x = torch.arange(x0, x1, device=device, dtype=torch.float32)[None]
        y = torch.arange(y0, y1, device=device, dtype=torch.float32)[:, None]
        return slice(y0, y1), slice(x0, x1), x, y

    def _blend(
        self, rows: slice, columns: slice, signed: Tensor, color: Vector | Tensor, opacity: float,
        shade: Tensor, covers: bool,
    ) -> None:  # fmt: skip
        alpha = (0.5 - signed).clamp(0, 1) * opacity
        paint = torch.as_tensor(color, device=self.rgb.device, dtype=torch.float32)
        paint = paint[:, None, None] if paint.ndim == 1 else paint[:, rows, columns]
        view = self.rgb[:, rows, columns]
        self.rgb[:, rows, columns] = view + alpha * (paint * shade - view)
        if covers:
            ids = self.ids[rows, columns]
            ids[alpha > 0.5] = 0


def blur(plane: Tensor, radius: int) -> Tensor:
    """(H, W) nearly Gaussian: two box filters of odd size 2·radius + 1, rows and columns apart."""
    if radius < 1:
        return plane
    size = 2 * radius + 1
    image = plane[None, None]
    for _ in range(2):
        image = F.avg_pool2d(image, (1, size), 1, (0, radius), count_include_pad=False)
        image = F.avg_pool2d(image, (size, 1), 1, (radius, 0), count_include_pad=False)
    return image[0, 0]


def shift(plane: Tensor, dx: int, dy: int) -> Tensor:
    """(H, W) moved by whole pixels, zeros coming in."""
    moved = torch.zeros_like(plane)
    h, w = plane.shape
    if abs(dx) < w and abs(dy) < h:
        moved[max(dy, 0) : h + min(dy, 0), max(dx, 0) : w + min(dx, 0)] = plane[
            max(-dy, 0) : h + min(-dy, 0), max(-dx, 0) : w + min(-dx, 0)
        ]
    return moved
