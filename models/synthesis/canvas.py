"""A picture being painted: color and who is on top, with soft-edged primitives."""

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
    """``rgb`` (3, H, W) float 0 to 1, ``ids`` (H, W) int16: 0 background, else the number of what
    is on top."""

    def __init__(self, rgb: Tensor) -> None:
        self.rgb = rgb
        self.height, self.width = rgb.shape[1:]
        self.ids = torch.zeros(rgb.shape[1:], dtype=torch.int16, device=rgb.device)

    @property
    def size(self) -> tuple[int, int]:
        return self.height, self.width

    def box(
        self,
        center: Vector,
        half: Vector,
        angle: float,
        color: Vector | Tensor,
        *,
        corner: float = 0.0,
        opacity: float = 1.0,
        bevel: float = 0.0,
        covers: bool = False,
    ) -> None:
        """Rotated rectangle with round corners (px, rad); ``bevel`` shades it along its own y axis.
        ``covers`` clears the ids below (an object lying on the DLOs)."""
        window = self._window(center, math.hypot(half[0], half[1]) + 2)
        if window is None:
            return
        rows, columns, x, y = window
        u, v = _turned(x - center[0], y - center[1], angle)
        signed = _box_distance(u, v, half, corner)
        shade = 1 + bevel * (v / max(half[1], 1e-3)).clamp(-1, 1)
        self._blend(rows, columns, signed, color, opacity, shade, covers)

    def disc(
        self,
        center: Vector,
        radius: float,
        color: Vector | Tensor,
        *,
        opacity: float = 1.0,
        bevel: float = 0.0,
        covers: bool = False,
    ) -> None:
        window = self._window(center, radius + 2)
        if window is None:
            return
        rows, columns, x, y = window
        signed = torch.hypot(x - center[0], y - center[1]) - radius
        shade = 1 + bevel * ((y - center[1]) / max(radius, 1e-3)).clamp(-1, 1)
        self._blend(rows, columns, signed, color, opacity, shade, covers)

    def drops(self, centers: Tensor, radii: Tensor, colors: Tensor) -> None:
        """Many small round drops at once: ``centers`` (n, 2) and ``radii`` (n,) px, ``colors`` (n,
        3). Where drops overlap, the later one covers."""
        reach = int(float(radii.max())) + 1
        around = torch.arange(-reach, reach + 1, device=centers.device)
        x = (centers[:, 0].round().long()[:, None, None] + around).expand(-1, len(around), -1)
        y = (centers[:, 1].round().long()[:, None, None] + around[:, None]).expand(
            -1, -1, len(around)
        )
        distance = torch.hypot(x - centers[:, 0, None, None], y - centers[:, 1, None, None])
        cover = (radii[:, None, None] + 0.5 - distance).clamp_(0, 1)
        hit = (cover > 0) & (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        drop = torch.arange(len(radii), device=centers.device)[:, None, None].expand(hit.shape)[hit]
        pixel = (y * self.width + x)[hit]
        top = torch.full((self.height * self.width,), -1, device=centers.device)
        alpha = cover[hit]
        rank = drop + len(radii) * (alpha > 0.5)  # a thin rim covers no other drop
        top.scatter_reduce_(0, pixel, rank, "amax")
        seen = top[pixel] == rank
        pixel, drop, alpha = pixel[seen], drop[seen], alpha[seen]
        flat = self.rgb.view(3, -1)
        flat[:, pixel] += alpha * (colors[drop].T - flat[:, pixel])

    def lattice(
        self,
        center: Vector,
        counts: tuple[int, int],
        pitch: tuple[float, float],
        angle: float,
        half: tuple[float, float],
        color: Vector,
        *,
        corner: float = 0.0,
        bevel: float = 0.0,
    ) -> None:
        """``counts`` equal rounded boxes in columns and rows ``pitch`` px apart, in one go: keys,
        holes, screws."""
        extent = counts[0] * pitch[0] / 2, counts[1] * pitch[1] / 2
        window = self._window(center, math.hypot(*extent) + 2)
        if window is None:
            return
        rows, columns, x, y = window
        u, v = _turned(x - center[0], y - center[1], angle)
        outside = (u.abs() > extent[0]) | (v.abs() > extent[1])
        u = torch.remainder(u + extent[0], pitch[0]) - pitch[0] / 2
        v = torch.remainder(v + extent[1], pitch[1]) - pitch[1] / 2
        signed = _box_distance(u, v, half, corner) + 1e3 * outside
        self._blend(
            rows, columns, signed, color, 1.0, 1 + bevel * (v / half[1]).clamp(-1, 1), False
        )

    def polygon(
        self, corners: Sequence[Vector], color: Vector, *, opacity: float = 1.0, bevel: float = 0.0
    ) -> None:
        """Convex polygon, corners clockwise on the screen (y down); ``bevel`` lightens its upper
        edge."""
        points = torch.tensor([[float(v) for v in corner] for corner in corners])
        middle = points.mean(0).tolist()
        reach = float((points - points.mean(0)).norm(dim=1).max())
        window = self._window(middle, reach + 2)
        if window is None:
            return
        rows, columns, x, y = window
        signed = torch.full((y.shape[0], x.shape[1]), -1e6, device=x.device)
        for (ax, ay), (bx, by) in zip(points.tolist(), points.roll(-1, 0).tolist(), strict=True):
            length = max(math.hypot(bx - ax, by - ay), 1e-6)
            signed = torch.maximum(signed, ((y - ay) * (ax - bx) + (x - ax) * (by - ay)) / length)
        shade = 1 + bevel * ((y - middle[1]) / max(reach, 1e-3)).clamp(-1, 1)
        self._blend(rows, columns, signed, color, opacity, shade, False)

    def darken(self, alpha: Tensor, strength: float) -> None:
        """Multiply by a shadow; ``alpha`` (H, W) 0 to 1."""
        self.rgb *= 1 - strength * alpha

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
        self,
        rows: slice,
        columns: slice,
        signed: Tensor,
        color: Vector | Tensor,
        opacity: float,
        shade: Tensor,
        covers: bool,
    ) -> None:
        alpha = (0.5 - signed).clamp(0, 1) * opacity
        paint = torch.as_tensor(color, device=self.rgb.device, dtype=torch.float32)
        paint = paint[:, None, None] if paint.ndim == 1 else paint[:, rows, columns]
        view = self.rgb[:, rows, columns]
        self.rgb[:, rows, columns] = view + alpha * (paint * shade - view)
        if covers:
            ids = self.ids[rows, columns]
            ids[alpha > 0.5] = 0


def blur(plane: Tensor, radius: int) -> Tensor:
    """(H, W) nearly Gaussian, of standard deviation ``radius`` px: two box filters of odd size,
    rows and columns apart; wide ones at half the resolution."""
    if radius < 1:
        return plane
    image = plane[None, None]
    if radius >= 4 and min(plane.shape) >= 16:
        half = F.avg_pool2d(image, 2, ceil_mode=True)[0, 0]
        return F.interpolate(blur(half, radius // 2)[None, None], plane.shape, mode="bilinear")[
            0, 0
        ]
    size = 2 * radius + 1
    for _ in range(2):
        image = F.avg_pool2d(image, (1, size), 1, (0, radius), count_include_pad=False)
        image = F.avg_pool2d(image, (size, 1), 1, (radius, 0), count_include_pad=False)
    return image[0, 0]


def _turned(x: Tensor, y: Tensor, angle: float) -> tuple[Tensor, Tensor]:
    cos, sin = math.cos(angle), math.sin(angle)
    return x * cos + y * sin, y * cos - x * sin


def _box_distance(u: Tensor, v: Tensor, half: Vector, corner: float) -> Tensor:
    """Signed distance to a box with round corners about the origin."""
    qx, qy = u.abs() - half[0] + corner, v.abs() - half[1] + corner
    return (
        torch.hypot(qx.clamp(min=0), qy.clamp(min=0)) + torch.maximum(qx, qy).clamp(max=0) - corner
    )
