"""Swin transformer as an encoder (Liu et al. 2021). Parameter names are those of the published
ImageNet weights.

Any size: features are filled up with zeros to whole windows, right and below. Sizes stay symbols
from end to end (no ``if`` on a size, no list of windows), so that one exported file serves every
size.

Left out: stochastic depth, a regularizer for a fixed data set; ours is rendered without end.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

_WINDOW = 7
_SHIFT = _WINDOW // 2
_HEAD = 32  # channels of a head at full width


def relative_index(window: int) -> Tensor:
    """(N, N) for N = window² tokens: which row of the bias table belongs to a pair of them (section
    3.2)."""
    rows, columns = torch.meshgrid(torch.arange(window), torch.arange(window), indexing="ij")
    place = torch.stack([rows.flatten(), columns.flatten()])
    dy, dx = place[:, :, None] - place[:, None, :] + window - 1
    return dy * (2 * window - 1) + dx


def to_windows(x: Tensor) -> Tensor:
    """(B, 7 r, 7 c, C) to (B, r c, 49, C)."""
    batch, height, width, channels = x.shape
    rows, columns = height // _WINDOW, width // _WINDOW
    x = x.view(batch, rows, _WINDOW, columns, _WINDOW, channels).transpose(2, 3)
    return x.reshape(batch, rows * columns, _WINDOW**2, channels)


def from_windows(x: Tensor, rows: int, columns: int) -> Tensor:
    """The inverse of :func:`to_windows`."""
    batch, channels = x.shape[0], x.shape[3]
    x = x.view(batch, rows, columns, _WINDOW, _WINDOW, channels).transpose(2, 3)
    return x.reshape(batch, rows * _WINDOW, columns * _WINDOW, channels)


def _turned(size: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """Where each place of a cyclic shift comes from, and whether it came around the edge.

    An axis of one window is not shifted (there is no neighbor to look at): its shift is clamped to
    0.
    """
    place = torch.arange(size, device=device)
    length = place[-1:] + 1  # ``size`` as a tensor: the exporter has no remainder by a symbol
    shifted = place + (length - _WINDOW).clamp(max=_SHIFT)
    return shifted % length, shifted >= length


class WindowAttention(nn.Module):
    """Self-attention among the tokens of a window with a learned bias per relative position."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.qkv, self.proj = nn.Linear(channels, 3 * channels), nn.Linear(channels, channels)
        self.relative_position_bias_table = nn.Parameter(torch.zeros((2 * _WINDOW - 1) ** 2, heads))
        nn.init.trunc_normal_(self.relative_position_bias_table, std=0.02)
        self.index: Tensor
        self.register_buffer("index", relative_index(_WINDOW), persistent=False)

    def forward(self, x: Tensor, apart: Tensor | None) -> Tensor:
        """``x`` (B, n, 49, C); ``apart`` (n, 49, 49) true for pairs that must not see one
        another."""
        batch, windows, tokens, channels = x.shape
        parts = self.qkv(x).view(batch, windows, tokens, 3, self.heads, channels // self.heads)
        q, k, v = parts.permute(3, 0, 1, 4, 2, 5).unbind(0)
        scores = q @ k.transpose(-2, -1) * (channels // self.heads) ** -0.5
        scores = scores + self.relative_position_bias_table[self.index].permute(2, 0, 1)
        if apart is not None:
            scores = scores - 100.0 * apart[:, None].to(scores.dtype)
        y = (scores.softmax(-1) @ v).transpose(2, 3)
        return self.proj(y.reshape(batch, windows, tokens, channels))


class Perceptron(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.fc1, self.act, self.fc2 = (
            nn.Linear(channels, 4 * channels),
            nn.GELU(),
            nn.Linear(4 * channels, channels),
        )

    def forward(self, x: Tensor) -> Tensor:
        return self.fc2(self.act(self.fc1(x)))


class Block(nn.Module):
    """Attention in windows, plain or ``shifted`` by half a window, then a perceptron; both with a
    skip."""

    def __init__(self, channels: int, heads: int, shifted: bool) -> None:
        super().__init__()
        self.shifted = shifted
        self.norm1, self.norm2 = nn.LayerNorm(channels), nn.LayerNorm(channels)
        self.attn, self.mlp = WindowAttention(channels, heads), Perceptron(channels)

    def forward(self, x: Tensor) -> Tensor:
        """(B, H, W, C) to the same."""
        x = x + self._attend(self.norm1(x))
        return x + self.mlp(self.norm2(x))

    def _attend(self, x: Tensor) -> Tensor:
        height, width = x.shape[1:3]
        rows, columns = (height + _WINDOW - 1) // _WINDOW, (width + _WINDOW - 1) // _WINDOW
        x = nn.functional.pad(x, (0, 0, 0, columns * _WINDOW - width, 0, rows * _WINDOW - height))
        if self.shifted:
            x = self._attend_shifted(x, rows, columns)
        else:
            x = from_windows(self.attn(to_windows(x), None), rows, columns)
        return x[:, :height, :width]

    def _attend_shifted(self, x: Tensor, rows: int, columns: int) -> Tensor:
        """What came around an edge shares a window with what did not; the two are kept apart
        (figure 4)."""
        down, below = _turned(rows * _WINDOW, x.device)
        right, beside = _turned(columns * _WINDOW, x.device)
        region = to_windows((2 * below[:, None].int() + beside[None, :].int())[None, :, :, None])[
            0, :, :, 0
        ]
        apart = region[:, :, None] != region[:, None, :]
        turned = x.index_select(1, down).index_select(2, right)
        y = from_windows(self.attn(to_windows(turned), apart), rows, columns)
        return y.index_select(1, down.argsort()).index_select(2, right.argsort())


class PatchMerging(nn.Module):
    """2 × 2 neighbors side by side, then a linear map to twice the channels."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm, self.reduction = (
            nn.LayerNorm(4 * channels),
            nn.Linear(4 * channels, 2 * channels, bias=False),
        )

    def forward(self, x: Tensor) -> Tensor:
        parts = [x[:, row::2, column::2] for column in (0, 1) for row in (0, 1)]
        return self.reduction(self.norm(torch.cat(parts, -1)))


class PatchEmbedding(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.proj, self.norm = nn.Conv2d(3, channels, 4, 4), nn.LayerNorm(channels)

    def forward(self, image: Tensor) -> Tensor:
        return self.norm(self.proj(image).permute(0, 2, 3, 1))


class Stage(nn.Module):
    """Blocks, every other one shifted; ``downsample`` follows them in all stages but the last."""

    def __init__(self, channels: int, heads: int, depth: int, last: bool) -> None:
        super().__init__()
        self.blocks = nn.Sequential(
            *(Block(channels, heads, shifted=k % 2 == 1) for k in range(depth))
        )
        self.downsample = nn.Identity() if last else PatchMerging(channels)


def _initialize(module: nn.Module) -> None:
    if isinstance(module, nn.Linear):
        nn.init.trunc_normal_(module.weight, std=0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


class Swin(nn.Module):
    """``depths`` blocks a stage: (2, 2, 6, 2) is Swin-T, (2, 2, 18, 2) Swin-S; ``width`` of the
    embedding."""

    stride = 32

    def __init__(self, depths: tuple[int, int, int, int], width: int = 3 * _HEAD) -> None:
        super().__init__()
        self.channels = width, 8 * width
        self.patch_embed = PatchEmbedding(width)
        self.layers: Iterable[Stage] = nn.ModuleList(  # type: ignore[assignment]
            Stage(width * 2**k, 3 * 2**k, depths[k], last=k == 3) for k in range(4)
        )
        self.norm = nn.LayerNorm(8 * width)
        self.apply(_initialize)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """(B, 3, H, W) to low-level features at stride 4 and high-level ones at stride 32."""
        x = self.patch_embed(image)
        stages = []
        for stage in self.layers:
            stages.append(stage.blocks(x))
            x = stage.downsample(stages[-1])
        return stages[0].permute(0, 3, 1, 2), self.norm(x).permute(0, 3, 1, 2)
