"""Recordings before a screen with known truth, made with the renderer: what the chroma key is
measured on.

    python -m models.synthesis.chroma_screen OUT --count 100 --seed 1 [--hue 120]

The cloth has wrinkles and uneven light, the cables cast shadows and take a little of the screen's
color, the camera adds blur and noise. Writes a labelled set; its pictures alone are a source for
``models.synthesis.chroma_key``.
"""

from __future__ import annotations

import argparse
import colorsys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis.cables import Cable, paint_cables
from models.synthesis.canvas import Canvas, blur
from models.synthesis.curves import random_curve
from models.synthesis.datasets import append_index, write_sample
from models.synthesis.looks import Color, random_color, random_light, random_look
from models.synthesis.scenes import to_uint8


@dataclass(frozen=True)
class Screen:
    """The cloth of one recording: ``hue_deg`` 0 to 360, saturation and value 0 to 1, size (height,
    width) px."""

    hue_deg: float
    saturation: float
    value: float
    size: tuple[int, int]


def random_screen(
    rng: np.random.Generator, hue_deg: float, size: tuple[int, int] = (192, 320)
) -> Screen:
    return Screen(hue_deg, float(rng.uniform(0.6, 0.9)), float(rng.uniform(0.5, 0.85)), size)


def render_before_screen(
    rng: np.random.Generator, screen: Screen, own_hue: bool = False
) -> tuple[NDArray[np.uint8], NDArray[np.int16]]:
    """Picture (H, W, 3) and instance ids (H, W); ``own_hue`` gives all cables the screen's hue."""
    canvas = Canvas(_cloth(rng, screen))
    cables = [_cable(rng, screen, own_hue) for _ in range(rng.integers(1, 4))]
    plan = paint_cables(canvas, cables, random_light(rng), rng)
    owner = np.array([0, *(piece.cable + 1 for piece in plan.pieces)], np.int16)
    return np.ascontiguousarray(to_uint8(_camera(rng, canvas.rgb))), owner[canvas.ids.numpy()]


def _cable(rng: np.random.Generator, screen: Screen, own_hue: bool) -> Cable:
    width = float(np.exp(rng.uniform(*np.log((0.014, 0.06)))) * screen.size[1])
    curve = random_curve(rng, screen.size, width)
    color = _own_color(rng, screen) if own_hue else _color_apart(rng, screen)
    second = color if own_hue else _color_apart(rng, screen)
    look = replace(random_look(rng, color, width), second=second, opacity=1.0)
    return Cable(curve, np.full(len(curve), width / 2, np.float32), look)


def _cloth(rng: np.random.Generator, screen: Screen) -> Tensor:
    color = torch.tensor(colorsys.hsv_to_rgb(screen.hue_deg / 360, screen.saturation, screen.value))
    light = torch.as_tensor(rng.normal(1.0, 0.13, (1, 1, 3, 4)).astype(np.float32))
    field = F.interpolate(light, screen.size, mode="bicubic", align_corners=True)[0, 0].clamp(
        0.5, 1.4
    )
    height, width = screen.size
    y, x = torch.meshgrid(torch.arange(height) / width, torch.arange(width) / width, indexing="ij")
    for _ in range(rng.integers(2, 7)):
        angle, place = rng.uniform(0, np.pi), rng.uniform(-0.3, 1.0)
        across = x * np.cos(angle) + y * np.sin(angle) - place + 0.02 * torch.sin(9 * (x - y))
        field = field * (
            1 + rng.uniform(-0.16, 0.16) * torch.exp(-((across / rng.uniform(0.008, 0.04)) ** 2))
        )
    return color[:, None, None] * field


def _color_apart(rng: np.random.Generator, screen: Screen) -> Color:
    """A cable's color at least 40° from the screen's hue, or with hardly any color."""
    while True:
        color = random_color(rng)
        hue, saturation, _ = colorsys.rgb_to_hsv(*color)
        if saturation < 0.12 or abs((360 * hue - screen.hue_deg + 180) % 360 - 180) > 40:
            return color


def _own_color(rng: np.random.Generator, screen: Screen) -> Color:
    return colorsys.hsv_to_rgb(screen.hue_deg / 360, rng.uniform(0.35, 1.0), rng.uniform(0.25, 0.9))


def _camera(rng: np.random.Generator, rgb: Tensor) -> Tensor:
    spill = rgb.mean((1, 2), keepdim=True)
    rgb = rgb + 0.04 * spill
    soft = torch.stack([blur(plane, 1) for plane in rgb])
    rgb = rgb + rng.uniform(0.0, 0.6) * (soft - rgb)
    noise = torch.as_tensor(rng.standard_normal(rgb.shape, dtype=np.float32))
    return (rgb + rng.uniform(0.005, 0.025) * noise).clamp(0, 1)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.synthesis.chroma_screen",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--hue", type=float, default=120.0, help="of the screen, in degrees: 120 green, 220 blue"
    )
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=360)
    args = parser.parse_args()
    screen = random_screen(np.random.default_rng(args.seed), args.hue, (args.height, args.width))
    for k in range(args.count):
        rgb, ids = render_before_screen(np.random.default_rng([args.seed, k]), screen)
        write_sample(args.out, f"{k:06d}", rgb, ids)
        append_index(args.out, {"name": f"{k:06d}"})


if __name__ == "__main__":
    main()
