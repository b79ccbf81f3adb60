"""Rendered clips: cables that move over one ground, and an arm that now and then covers a part of
them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.cables import Cable, paint_cables
from models.synthesis.canvas import Canvas
from models.synthesis.curves import FloatArray, axes, interpolate
from models.synthesis.looks import random_color, random_light, random_look
from models.synthesis.textures import TexturePool

Rng = np.random.Generator
_CONTROLS = 9
_ARM = np.array([1.0, 0.45])
"""Half its length and width, as parts of its size."""


@dataclass(frozen=True)
class ClipParams:
    """``frames`` of ``size`` (height, width) px with ``cables`` of ``width_px``; ``speed`` in
    widths a frame, at most; ``same_look`` paints all alike. In the frames ``covered`` (start, stop)
    an arm lies over about ``share`` of the length of all cables."""

    size: tuple[int, int] = (360, 640)
    frames: int = 300
    cables: int = 4
    width_px: float = 9.0
    speed: float = 0.5
    same_look: bool = True
    covered: tuple[int, int] = (0, 0)
    share: float = 0.4


@dataclass(frozen=True, eq=False)
class Frame:
    """``rgb`` (3, H, W) float; ``ids`` (H, W) int16, k the k-th cable where it is on top;
    ``centerlines`` (m, 2) px from the same end in every frame; ``in_view`` (m,) which of these are
    on top and in the picture."""

    rgb: Tensor
    ids: Tensor
    centerlines: tuple[FloatArray, ...]
    in_view: tuple[NDArray[np.bool_], ...]

    @property
    def visible(self) -> tuple[float, ...]:
        """Share of each cable that is in view."""
        return tuple(float(seen.mean()) for seen in self.in_view)


class Course(Protocol):
    """How a cable moves."""

    def at(self, t: int) -> FloatArray:
        """(m, 3) dense centerline at frame ``t``: x, y px, height."""


def render_clip(
    rng: Rng,
    params: ClipParams,
    pool: TexturePool,
    course: Callable[[Rng, ClipParams], Course] | None = None,
) -> Iterator[Frame]:
    """Frame after frame; everything random comes from ``rng``, drawn before the first one. The
    cables move on courses drawn by ``course``; without, they drift, turn and bend."""
    ground = pool.sample(rng, params.size, torch.device("cpu"))
    courses = [(course or _Course)(rng, params) for _ in range(params.cables)]
    look = random_look(rng, random_color(rng), params.width_px)
    looks = [
        look if params.same_look else random_look(rng, random_color(rng), params.width_px)
        for _ in courses
    ]
    light, noise = random_light(rng), rng.uniform(0.005, 0.02)
    middle, angle = (
        rng.uniform((0.3, 0.3), (0.7, 0.7)) * params.size[::-1],
        rng.uniform(-np.pi, np.pi),
    )
    arm = _arm([one.at(params.covered[0]) for one in courses], middle, angle, params)
    for t in range(params.frames):
        canvas = Canvas(ground.clone())
        curves = [one.at(t) for one in courses]
        painted = [
            Cable(c, np.full(len(c), params.width_px / 2, np.float32), k)
            for c, k in zip(curves, looks, strict=True)
        ]
        plan = paint_cables(canvas, painted, light, np.random.default_rng(0))
        if params.covered[0] <= t < params.covered[1]:
            _cover(canvas, middle + 20 * np.array([np.sin(0.1 * t), np.cos(0.13 * t)]), arm, angle)
        owner = torch.tensor([0, *(p.cable + 1 for p in plan.pieces)], dtype=torch.int16)
        ids = owner[canvas.ids.long()]
        rgb = canvas.rgb + noise * torch.as_tensor(
            rng.standard_normal(canvas.rgb.shape, dtype=np.float32)
        )
        lines = tuple(c[:, :2] for c in curves)
        yield Frame(
            rgb.clamp(0, 1),
            ids,
            lines,
            tuple(_seen(ids, c, k) for k, c in enumerate(lines, start=1)),
        )


class _Course:
    """A cable that drifts, turns and bends slowly about a first shape, as one that hands or an arm
    move. It does not stretch: what changes with time is the direction along it."""

    def __init__(self, rng: Rng, params: ClipParams) -> None:
        height, width = params.size
        along = axes(rng.uniform(-np.pi, np.pi))
        length, self.middle = (
            rng.uniform(0.5, 0.8) * width,
            rng.uniform((0.35, 0.35), (0.65, 0.65)) * (width, height),
        )
        u = np.linspace(-0.5, 0.5, _CONTROLS)
        wave = sum(
            rng.normal(0, 0.07 / k) * length * np.sin(2 * np.pi * k * u + rng.uniform(0, 6))
            for k in (0.5, 1.0, 1.5)
        )
        xy = (u * length)[:, None] * along[0] + np.asarray(wave)[:, None] * along[1]
        height_above = np.cumsum(rng.normal(0, 0.2, _CONTROLS)) + rng.uniform(0, 1)
        line = interpolate(np.column_stack([xy, height_above]).astype(np.float32), 0.7)
        steps = np.diff(line[:, :2], axis=0)
        self.height_above, self.step = line[:, 2], np.hypot(*steps.T)
        self.angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        # What is added to the direction: all of it, one end against the other, the middle against
        # the ends.
        at = np.linspace(-0.5, 0.5, len(steps))
        self.modes = np.stack([np.ones_like(at), 2 * at, np.cos(2 * np.pi * at)])
        self.turn = rng.uniform(0.015, 0.05, 5)
        self.phase = rng.uniform(0, 2 * np.pi, 5)
        # Speed of a swing is its reach times its rate; an end turns at half the length from the
        # middle.
        reach = params.speed * params.width_px / self.turn * rng.uniform(0.2, 0.5, 5)
        self.reach = reach / np.array([1, 1, *[0.5 * float(self.step.sum())] * 3])

    def at(self, t: int) -> FloatArray:
        """(m, 3) dense centerline at frame ``t``."""
        swing = self.reach * np.sin(self.turn * t + self.phase)
        angle = self.angle + swing[2:] @ self.modes
        steps = self.step[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        xy = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        xy += self.middle + swing[:2] - xy[len(xy) // 2]
        return np.column_stack([xy, self.height_above]).astype(np.float32)


def _arm(
    curves: list[FloatArray], middle: FloatArray, angle: float, params: ClipParams
) -> FloatArray:
    """Half the length and width (2,) px of a box about ``middle`` that covers the share of the
    cables in view."""
    points = np.concatenate(curves)[:, :2]
    points = points[((points >= 0) & (points < params.size[::-1])).all(1)]
    away = np.abs((points - middle) @ np.array(axes(angle)).T)
    # A box of a given form grows until it holds the share: of each point, the size at which it is
    # inside.
    return np.asarray(
        _ARM * np.quantile((away / _ARM).max(1), params.share) if len(points) else _ARM
    )


def _cover(canvas: Canvas, at: FloatArray, half: FloatArray, angle: float) -> None:
    canvas.box(at, half, angle, (0.35, 0.36, 0.4), corner=0.1 * half[1], bevel=0.3, covers=True)


def _seen(ids: Tensor, line: FloatArray, number: int) -> NDArray[np.bool_]:
    """(m,) which points of a cable's centerline are its own pixels."""
    column, row = np.rint(line).astype(int).T
    inside = (row >= 0) & (column >= 0) & (row < ids.shape[0]) & (column < ids.shape[1])
    inside[inside] &= ids.numpy()[row[inside], column[inside]] == number
    return np.asarray(inside)
